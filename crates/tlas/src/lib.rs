//! Two-level BVHs: instances of bottom-level BVHs under any affine transform, static or moving.
//!
//! ```
//! use canted_bvh2::{BuildConfig, Bvh2};
//! use canted_obb::Affine;
//! use canted_tlas::{Instance, Tlas, TopConfig};
//! use canted_trace::{Ray, Watertight};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
//! let tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::IDENTITY)], TopConfig::default())?;
//! let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.instance.0, hit.primitive.0), (1.0, 0, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod blas;
mod edit;
mod error;
mod file;
mod instance;
mod motion;
mod options;
mod placement;
mod queries;
mod slices;
mod tlas;
mod top;

pub use blas::{Blas, CrossingBlas};
pub use edit::TlasEdit;
pub use error::InstanceError;
pub use file::{SaveBlas, TlasLoadError};
pub use instance::{Instance, MAX_CONDITION};
pub use motion::{Motion, row_sum_norm};
pub use options::RayOptions;
pub use tlas::Tlas;
pub use top::TopConfig;
