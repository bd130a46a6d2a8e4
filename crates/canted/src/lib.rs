//! Ray tracing with oriented bounding boxes.
#![forbid(unsafe_code)]

pub use canted_lbvh::GeometryError;
pub use canted_obb::{Aabb, Affine, Obb};
pub use canted_tlas::{Blas, Instance, InstanceError, Tlas};
pub use canted_trace::{BaldwinWeber, Hit, InstanceId, MollerTrumbore, Ray, Side, Watertight};
pub use canted_wide::{Config, Preset, TriangleBvh};
