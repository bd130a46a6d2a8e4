//! Two-level ray tracing: instances of bottom levels under any affine transform.
//!
//! ```text
//! triangles -> canted-lbvh -> binary (traced form) -> MeshBlas
//! MeshBlas + Affine -> instance -> canted-lbvh over root boxes -> Tlas -> closest_hit, occluded
//! ```
//!
//! A direction is never renormalised on its way down, so `t` is one number at every level.
#![forbid(unsafe_code)]

mod binary;
mod blas;
mod instance;
mod top;

pub use binary::{Binary, TracedLeaf};
pub use blas::{Blas, BuildConfig, MeshBlas};
pub use instance::{Instance, InstanceError, MAX_CONDITION};
pub use top::Tlas;
