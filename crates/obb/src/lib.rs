//! Oriented bounding boxes (OBBs): fit them to points and triangles, merge them, and test containment exactly.
//!
//! ```
//! use canted_obb::{Fit, fit};
//!
//! let strut = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [7.0, 7.0, 7.0], [7.1, 7.0, 7.0]];
//! let oriented = fit(&strut, &[], Fit::Pca)?;
//! let aligned = fit(&strut, &[], Fit::Aabb)?;
//! assert!(strut.iter().all(|&point| oriented.contains(point)));
//! assert!(oriented.area() < 0.1 * aligned.area());
//! # Ok::<(), canted_obb::FitError>(())
//! ```
//!
//! # When to use it
//! Use it to bound thin or rotated geometry more tightly than an axis-aligned box does, for culling, collision tests or
//! a BVH of your own. For ray tracing, use the crate `canted`, which builds oriented BVHs on it. The fits are fast
//! approximations; none searches for the box of least volume.
//!
//! # Main items
//!
//! | item | purpose |
//! |---|---|
//! | [`Obb`], [`Aabb`] | oriented and axis-aligned boxes |
//! | [`fit()`], [`Fit`] | box of a point set or mesh: PCA, area-weighted PCA, DiTO, DOP |
//! | [`merge`] | box of two boxes or triangles, for building a hierarchy from the leaves up |
//! | [`Moments`], [`Dop`] | statistics that merge in constant time and propose frames |
//! | [`bound`], [`Enclosure`] | tightest box along given axes, skewed ones included |
//! | [`rotation`] | rotation part of a matrix, safe for singular and mirroring matrices |
//! | [`Affine`] | affine maps; [`Obb::transformed`] bounds the exact image |
//!
//! # Guarantees
//! Fitting computes in `f64` and rounds outward: a box contains its points *exactly*, by the rational definition in
//! [`Obb::contains`]. Results are deterministic, and the same bits under scaling by powers of two.
//!
//! # Points
//! A point is anything that converts into `[f32; 3]`, such as the vectors of glam, nalgebra or mint. Pass a slice of
//! such vectors with `bytemuck::cast_slice`.
//!
//! # Cost
//! A box takes 60 bytes. Fits take linear time and allocate nothing.
//!
//! # Features
//! - `std` (default): float functions of the standard library.
//! - `bytemuck`: boxes and maps implement `bytemuck::Pod`.
//! - `libm`: float functions of the crate `libm`, for `no_std` targets; disable the default features.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod aabb;
mod affine;
mod bound;
pub mod dop;
pub mod eigen;
mod fit;
pub mod frame;
pub mod merge;
mod moments;
mod obb;
mod orientation;
mod quaternion;
pub mod rotation;
#[doc(hidden)]
pub mod round;
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
pub use orientation::{flat_as_edge, is_flat, orient_2d, orient_2d_f64, orient_3d, orient_3d_f64};
pub use quaternion::Quaternion;

/// Index of a primitive in the caller's array.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[repr(transparent)]
pub struct PrimId(pub u32);

impl PrimId {
    /// The index as an array position.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl core::fmt::Display for PrimId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.fmt(f)
    }
}
