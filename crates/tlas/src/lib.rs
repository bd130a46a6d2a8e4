//! Two-level ray tracing: instances of bottom levels under any affine transform.
//!
//! ```text
//! triangles -> canted-lbvh -> binary (traced form) -> MeshBlas
//! MeshBlas | canted-wide + Affine -> instance -> top: wide | binary, over root boxes -> Tlas -> closest_hit, occluded
//! ```
//!
//! A direction is never renormalised on its way down, so `t` is one number at every level.
//!
//! ```
//! use canted_tlas::{Blas, BuildConfig, MeshBlas};
//! use canted_trace::{InstanceId, Ray, Watertight};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let tree = MeshBlas::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
//! let ray = Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]);
//! let hit = tree.closest_hit(&ray, InstanceId(0), &mut ()).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.primitive.0), (1.0, 0));
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
#![forbid(unsafe_code)]

mod binary;
mod blas;
mod instance;
mod motion;
mod tlas;
mod top;

pub use binary::{Binary, PairOrder, TracedLeaf};
pub use blas::{Blas, BuildConfig, MeshBlas};
pub use instance::{Instance, InstanceError, MAX_CONDITION};
pub use motion::{Motion, row_sum_norm};
pub use tlas::Tlas;
pub use top::TopConfig;
