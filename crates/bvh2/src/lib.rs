//! Binary BVHs for ray tracing, with axis-aligned or oriented boxes in any node.
//!
//! ```
//! use canted_bvh2::{BuildConfig, Bvh2};
//! use canted_trace::{Ray, Watertight};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
//! let hit = bvh.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.primitive.0), (1.0, 0));
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
#![forbid(unsafe_code)]

mod bvh2;
mod pairs;
mod queries;

pub use bvh2::{BuildConfig, Bvh2};
pub use pairs::{OrientedLeaf, PairBvh, PairOrder};
