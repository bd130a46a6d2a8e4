//! Two-level ray tracing: instances of bottom levels under any affine transform.
//!
//! ```text
//! triangles -> canted-lbvh -> binary (traced form) -> Bvh2
//! Bvh2 | canted-wide + Affine -> instance -> top: wide | binary, over root boxes -> Tlas -> closest_hit, occluded
//! ```
//!
//! A direction is never renormalised on its way down, so `t` is one number at every level.
//!
//! ```
//! use canted_bvh2::{BuildConfig, Bvh2};
//! use canted_obb::Affine;
//! use canted_tlas::{Instance, Tlas, TopConfig};
//! use canted_trace::{Ray, Watertight};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
//! let tlas = Tlas::new(vec![bvh], &[Instance::still(0, Affine::IDENTITY)], TopConfig::default())?;
//! let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.instance.0, hit.primitive.0), (1.0, 0, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod blas;
mod instance;
mod motion;
mod tlas;
mod top;

pub use blas::Blas;
pub use instance::{Instance, InstanceError, MAX_CONDITION};
pub use motion::{Motion, row_sum_norm};
pub use tlas::Tlas;
pub use top::TopConfig;
