//! Ray-triangle kernels behind one trait.
//!
//! Each kernel is a fast f32 filter followed by an f64 test. The filter rejects certain misses, by the line of the ray and
//! the triangle alone; the f64 test decides and computes the hit. So SIMD lanes may filter in any width and order without
//! changing a bit of the results.

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

/// Maximum distance of a reported point from the exact triangle: each coordinate of `o + t·d`, in real arithmetic with
/// the reported `t`, is within `HIT_ERROR·M + 2^-127` of some point of the triangle.
///
/// `M` is the greatest `|v - o|∞` of the vertices `v` and the ray's origin `o`: the error does not depend on where both are
/// in their space. For every point `c` it is at most `|o - c|∞ + ρ∞`, ρ∞ the greatest `|v - c|∞`. With u = 2^-24 the
/// watertight kernel needs 6.1 u (proof at [`Watertight`]), the other two 18.1 u (proof at `finish`); the rest
/// allows the caller one more rounding of the point.
pub const HIT_ERROR: f32 = 20.0 * UNIT_ROUNDOFF;

/// A hit of a scaled ray on a triangle, with barycentric coordinates `(1 - u - v, u, v)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Scaled ray parameter; see [`ScaledRay::caller_t`].
    pub t: f32,
    /// Barycentric coordinate of the second vertex, from 0 to 1; `u + v` exceeds 1 by at most 2^-21.
    pub u: f32,
    /// Barycentric coordinate of the third vertex, from 0 to 1.
    pub v: f32,
    /// The side hit, by the winding of the vertices.
    pub side: Side,
}

/// Which [`Kernel`] tests the triangles of a BVH.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum TriangleTest {
    /// [`Watertight`]: no ray passes between triangles that share an edge.
    #[default]
    Watertight,
    /// [`MollerTrumbore`].
    MollerTrumbore,
    /// [`BaldwinWeber`]: records of 68 bytes instead of 36.
    BaldwinWeber,
}

/// A ray-triangle test. Triangles are stored as records; a ray is prepared once for all triangles.
///
/// Back faces are not culled. The interval is closed: `t_min <= t <= t_max`.
pub trait Kernel: Send + Sync + 'static {
    /// What is stored for a triangle.
    type Record: Copy + Send + Sync + 'static;
    /// What is precomputed for a ray, in the space of the triangles.
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
