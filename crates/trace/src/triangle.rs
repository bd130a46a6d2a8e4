//! Ray-triangle kernels behind one trait.
//!
//! Each kernel is a cheap f32 filter and an f64 finish. The filter only says "certainly not" or "perhaps", and its
//! answer depends on the ray's line and the triangle alone; the finish decides and computes. So SIMD lanes may filter
//! in any width and any order, and the reported bits never differ.

mod axis;
pub(crate) mod baldwin_weber;
pub(crate) mod filter;
pub(crate) mod finish;
pub(crate) mod moller_trumbore;
mod watertight;

pub use axis::Axis;
pub use baldwin_weber::{BaldwinWeber, BaldwinWeberRecord};
pub use moller_trumbore::MollerTrumbore;
pub use watertight::{Shear, Watertight};

use crate::rounding::UNIT_ROUNDOFF;
use crate::{ScaledRay, Side};

/// How far a reported point may lie from the true triangle: each coordinate of `o + t·d`, in real arithmetic with the
/// reported `t`, is within `HIT_ERROR·(|o|∞ + ρ∞) + 2^-127` of that of some point of the triangle.
///
/// `|o|∞` and `ρ∞` are the greatest absolute coordinates of the ray's origin and of the vertices. With u = 2^-24 the
/// watertight kernel needs 6.1 u (proof at [`Watertight`]), the other two 18.1 u (proof at `finish`); the rest
/// is room for one more rounding of the point by its user.
pub const HIT_ERROR: f32 = 20.0 * UNIT_ROUNDOFF;

/// Where a scaled ray meets a triangle, by weights `(1 - u - v, u, v)` of its vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance in units of the scaled direction; [`ScaledRay::caller_t`] takes it back.
    pub t: f32,
    /// Weight of the second vertex, not negative.
    pub u: f32,
    /// Weight of the third vertex, not negative.
    pub v: f32,
    /// The side met, by the winding of the vertices.
    pub side: Side,
}

/// A ray-triangle test: triangles become records once, a ray is prepared once, then they meet.
///
/// Back faces are hit like front faces. The interval is closed: `t_min <= t <= t_max`.
pub trait Kernel: Send + Sync + 'static {
    /// What is stored for a triangle.
    type Record: Copy + Send + Sync + 'static;
    /// What is computed once for a ray, in the space of the triangles.
    type Prepared: Copy;

    /// The record of the triangle with these vertices, which must be finite.
    fn record(vertices: [[f32; 3]; 3]) -> Self::Record;

    /// Prepares `ray`.
    fn prepare(ray: &ScaledRay) -> Self::Prepared;

    /// The hit with `ray.t_min <= t <= t_max`, or `None`.
    ///
    /// `prepared` must come from `ray`; `t_max` replaces the ray's own, so that a traversal can shrink it.
    fn intersect(prepared: &Self::Prepared, ray: &ScaledRay, record: &Self::Record, t_max: f32) -> Option<TriangleHit>;
}
