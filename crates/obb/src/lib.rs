//! Oriented bounding boxes: fitted to points and triangles, merged, and never too small.
//!
//! ```text
//! points, triangles -> fit/{aabb, pca, area_pca, dito, dop} -> Obb
//! Obb, Obb          -> merge/{bounded, quaternion, ...}     -> Obb
//! ```
//!
//! Geometry is plain `[f32; 3]`, so a user's vector library never matters. Fitting computes in `f64` and rounds
//! outward: a box contains its points *exactly*, by the rational definition in [`Obb::contains`].
#![forbid(unsafe_code)]

mod aabb;
mod affine;
mod obb;
mod prim;

pub use aabb::Aabb;
pub use affine::Affine;
pub use obb::Obb;
pub use prim::PrimId;
