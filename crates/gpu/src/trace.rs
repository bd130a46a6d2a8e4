//! Ray tracing on the device.
//!
//! ```text
//! TriangleBvh, or one per mesh + instances -> TracedScene -> closest hits, occlusion; bindings of other kernels
//! ```
//!
//! The device traverses the CPU's BVHs unchanged. Only the top-level BVH over instances is built here.

mod alternatives;
mod cast;
mod motion;

mod coordinates;
mod layout;
mod nodes;
mod ray;
mod scene;
mod top_level;

pub use alternatives::Traversal;
pub use cast::Outcome;
pub use coordinates::MAX_COORDINATE;
pub use layout::HIT_ERROR;
pub use motion::MotionPolynomials;
pub use ray::{DeviceHit, DeviceRay};
pub use scene::TracedScene;
pub use top_level::MAX_CONDITION;
