//! Ray tracing on the device.
//!
//! ```text
//! TriangleBvh, or one per mesh + instances -> upload ------------> TracedScene -> closest hits, occlusion; bindings of other kernels
//! corners of meshes + instances            -> build on the device -^   binary, or collapsed into wide nodes
//!                                          -> build by the driver -^   for its ray queries
//!                                                    TracedScene -> download -> a BVH of the CPU
//! ```
//!
//! A module imports only those above it.

mod layout;

mod aligned;
mod frames;
mod octants;
mod packed;
mod ray_list;

mod leaf_curves;
mod leaf_triangles;

mod instances;

mod driver;
mod nodes;
mod tables;

mod scene;
mod source;

mod download;
mod module;
mod query;
mod stream;

mod buffer_scene;
mod instanced_scene;

pub use buffer_scene::{BufferConfig, BufferScene};
pub use download::DownloadedBvh;
pub use instanced_scene::InstancedScene;
pub use instances::{MAX_CONDITION, MotionPolynomials};
pub use layout::{DeviceHit, DeviceRay, HIT_ERROR, MAX_COORDINATE, ModuleHit};
pub use leaf_curves::{DeviceCurve, HostCurves};
pub use nodes::DeviceBvh;
pub use query::Outcome;
pub use ray_list::RayList;
pub use scene::TracedScene;
pub use source::{HostBvh, Options, Source};
pub use stream::StreamQueries;
