//! Ray tracing on the device.
//!
//! ```text
//! TriangleBvh, or one per mesh + instances -> upload ------------> TracedScene -> closest hits, occlusion; bindings of other kernels
//! corners of meshes + instances            -> build on the device -^   binary, or collapsed into wide nodes
//! ```

mod binary;
mod buffers;
mod built_wide;
mod cast;
mod device_bvh;
mod motion;

mod coordinates;
mod headers;
mod instanced;
mod layout;
mod level;
mod module;
mod nodes;
mod ray;
mod scene;
mod top_level;
mod wide;

pub use buffers::BufferScene;
pub use cast::Outcome;
pub use coordinates::MAX_COORDINATE;
pub use device_bvh::DeviceBvh;
pub use instanced::InstancedScene;
pub use layout::HIT_ERROR;
pub use motion::MotionPolynomials;
pub use ray::{DeviceHit, DeviceRay};
pub use scene::TracedScene;
pub use top_level::MAX_CONDITION;
