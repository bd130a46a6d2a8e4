//! Ray-triangle kernels behind one trait.
//!
//! Each kernel is a fast f32 filter followed by an f64 test. The filter rejects certain misses, by the line of the ray and
//! the triangle alone; the f64 test decides and computes the hit. So SIMD lanes may filter in any width and order without
//! changing a bit of the results.

pub(crate) mod baldwin_weber;
pub(crate) mod moller_trumbore;
pub(crate) mod projected;
mod watertight;

pub use baldwin_weber::{BaldwinWeber, BaldwinWeberRecord};
pub use moller_trumbore::MollerTrumbore;
pub use projected::{Projected, ProjectedRecord};
pub use watertight::{Axis, Shear, Watertight};

use core::fmt;

use crate::rounding::UNIT_ROUNDOFF;
use crate::{ScaledRay, Side};

/// Maximum distance of a reported point from the exact triangle: each coordinate of `o + t·d`, in real arithmetic with
/// the reported `t`, is within `HIT_ERROR·M + 2^-127` of some point of the triangle.
///
/// `M` is the greatest `|v - o|∞` of the vertices `v` and the ray's origin `o`: the error does not depend on where both are
/// in their space. For every point `c` it is at most `|o - c|∞ + ρ∞`, ρ∞ the greatest `|v - c|∞`. With u = 2^-24 the
/// watertight kernel needs 6.1 u (proof at [`Watertight`]), the other three 18.1 u (proof at `moller_trumbore::finish`); the rest
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

/// A ray-triangle test. Triangles are stored as records; a ray is prepared once for all triangles.
///
/// Back faces are not culled. The interval is closed: `t_min <= t <= t_max`.
pub trait Kernel: Send + Sync + 'static {
    /// What is stored for a triangle.
    type Record: Copy + Send + Sync + 'static;
    /// What is precomputed for a ray, in the space of the triangles.
    type Prepared: Copy;

    /// The record of the triangle with these vertices, which must be finite. Nothing hits a triangle without area
    /// ([`canted_obb::is_flat`]): its record is that of an edge ([`canted_obb::flat_as_edge`]).
    fn record(vertices: [[f32; 3]; 3]) -> Self::Record;

    /// Prepares `ray`.
    fn prepare(ray: &ScaledRay) -> Self::Prepared;

    /// The hit with `ray.t_min <= t <= t_max`, or `None`.
    ///
    /// `prepared` must come from `ray`; `t_max` replaces the ray's own, so that a traversal can shrink it.
    fn intersect(prepared: &Self::Prepared, ray: &ScaledRay, record: &Self::Record, t_max: f32) -> Option<TriangleHit>;
}

/// A triangle test, chosen at run time: each is a [`Kernel`].
///
/// Its names, in [`Display`](fmt::Display) and [`FromStr`](core::str::FromStr), are `watertight`, `moller-trumbore` and `baldwin-weber`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TriangleTest {
    /// [`Watertight`]: no ray passes between the triangles of a closed mesh.
    #[default]
    Watertight,
    /// [`MollerTrumbore`], for comparison.
    MollerTrumbore,
    /// [`BaldwinWeber`], for comparison: records of 68 bytes instead of 36, where they are stored one by one.
    BaldwinWeber,
}

impl TriangleTest {
    /// All tests.
    pub const ALL: [Self; 3] = [Self::Watertight, Self::MollerTrumbore, Self::BaldwinWeber];

    /// Its name in options and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Watertight => "watertight",
            Self::MollerTrumbore => "moller-trumbore",
            Self::BaldwinWeber => "baldwin-weber",
        }
    }

    /// How far its hits may lie from their triangle, relative to the greatest `|v - o|∞` of its vertices and the ray's origin: at most
    /// [`HIT_ERROR`].
    #[must_use]
    pub const fn hit_error(self) -> f32 {
        match self {
            Self::Watertight => 7.0 * UNIT_ROUNDOFF,
            Self::MollerTrumbore | Self::BaldwinWeber => HIT_ERROR,
        }
    }
}

impl fmt::Display for TriangleTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no [`TriangleTest`] has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownTriangleTest;

impl fmt::Display for UnknownTriangleTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no triangle test; expected watertight, moller-trumbore or baldwin-weber")
    }
}

impl core::error::Error for UnknownTriangleTest {}

impl core::str::FromStr for TriangleTest {
    type Err = UnknownTriangleTest;

    fn from_str(name: &str) -> Result<Self, UnknownTriangleTest> {
        Self::ALL.into_iter().find(|test| test.name() == name).ok_or(UnknownTriangleTest)
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn tests_have_the_names_that_they_are_read_by() {
        for test in TriangleTest::ALL {
            assert_eq!(test.to_string().parse(), Ok(test));
        }
        assert_eq!("Watertight".parse::<TriangleTest>(), Err(UnknownTriangleTest));
    }
}
