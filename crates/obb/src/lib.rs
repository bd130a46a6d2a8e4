//! Oriented bounding boxes: fitted to points and triangles, merged, and never too small.
//!
//! ```text
//! points, triangles -> fit/{pca, area_pca, dito, dop}       -> Obb
//! Obb, Obb          -> merge/{bounded, quaternion, best}    -> Obb
//! moments, extents carried up a tree -> frame -> bound      -> Obb
//! ```
//!
//! Geometry is plain `[f32; 3]`, so a user's vector library never matters. Fitting computes in `f64` and rounds
//! outward: a box contains its points *exactly*, by the rational definition in [`Obb::contains`].
//!
//! ```
//! use canted_obb::{Fit, fit};
//!
//! let strut = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [7.0, 7.0, 7.0], [7.1, 7.0, 7.0]];
//! let leaning = fit(&strut, &[], Fit::Pca)?;
//! let straight = fit(&strut, &[], Fit::Aabb)?;
//! assert!(strut.iter().all(|&point| leaning.contains(point)));
//! assert!(leaning.area() < 0.1 * straight.area());
//! # Ok::<(), canted_obb::FitError>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod aabb;
mod affine;
mod bound;
mod contains;
pub mod dop;
pub mod eigen;
mod expansion;
mod fit;
pub mod frame;
mod math;
pub mod merge;
mod moments;
mod obb;
mod prim;
mod quaternion;
pub mod rotation;
mod round;
#[doc(hidden)]
pub mod vector;

pub use aabb::Aabb;
pub use affine::Affine;
pub use bound::{Enclosure, bound, bound_boxes};
pub use dop::Dop;
pub use fit::{Fit, FitError, fit};
pub use frame::Frame;
pub use moments::Moments;
pub use obb::Obb;
pub use prim::PrimId;
pub use quaternion::Quaternion;
