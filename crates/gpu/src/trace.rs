//! Rays through a scene in the device's memory.
//!
//! ```text
//! Wide (one tree), or Wide a mesh + instances -> TracedScene -> closest hits and occlusion of rays; parts of other kernels
//! ```
//!
//! The device walks the words that the CPU walks; what it needs besides is a tree of boxes around instances, made here.

mod cast;
mod motion;

mod coordinates;
mod layout;
mod ray;
mod scene;
mod top_level;
mod traversal;

pub use cast::Outcome;
pub use coordinates::MAX_COORDINATE;
pub use layout::HIT_ERROR;
pub use motion::MotionPolynomials;
pub use ray::{DeviceHit, DeviceRay};
pub use scene::TracedScene;
pub use top_level::MAX_CONDITION;
pub use traversal::Traversal;
