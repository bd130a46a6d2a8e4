//! Rays through a scene in the device's memory.
//!
//! ```text
//! Wide (one tree), or Wide a mesh + instances -> TracedScene -> closest hits and occlusion of rays; parts of other kernels
//! ```
//!
//! The device walks the words that the CPU walks; what it needs besides is a tree of boxes around instances, made here.

mod cast;
mod motion;
mod outer;
mod ray;
mod reach;
mod scene;
mod walk;
mod words;

pub use cast::Answer;
pub use motion::MotionPolynomials;
pub use outer::MAX_CONDITION;
pub use ray::{DeviceHit, DeviceRay};
pub use reach::MOST_REACH;
pub use scene::TracedScene;
pub use walk::Walk;
pub use words::HIT_ERROR;
