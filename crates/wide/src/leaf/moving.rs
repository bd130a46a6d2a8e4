//! Primitives whose points and radii move in straight lines while the shutter is open.
//!
//! # No lost hit
//! At the time of a ray the primitive has the numbers that lie between both ends, as [`position_at`](canted_trace::position_at)
//! states. A ball whose center and radius are between those of two balls, in real arithmetic, is in their convex hull; so an
//! interval around both along a direction contains it at all times, and so do the control hulls of curves, ribbons and patches,
//! which are convex hulls of balls or points. Rounding moves a number by at most `(2^-24 + 2^-50)·r`, with r the greatest absolute
//! number of points and radii: a center by √3 times that along any direction, a radius by as much as a number, and a point of a curve
//! or patch by as much as its control points. Together this is less than `3·2^-24·r + 2^-147`, which is added to the intervals and to
//! the bounds. A hit has the error of the primitive at that time, relative to points of the bounds.
//!
//! Source: Glassner 1988 for boxes that hold at all times, as in `query::moving`.

use canted_obb::round::{down, up};
use canted_obb::{Aabb, Moments};
use canted_trace::{BezierPatch, RibbonCubic, RibbonSegment, RoundCubic, RoundSegment, ScaledRay, Sphere, numbers_at};

use super::primitive::{Primitive, PrimitiveHit, SavedPrimitive};

/// A primitive that is the convex combination of two others, number by number: those of this crate that are made of points and radii.
pub trait Moves: Primitive + Copy + sealed::Sealed {
    /// The primitive at a time of the shutter, each number as [`position_at`](canted_trace::position_at) computes a coordinate.
    #[must_use]
    fn between(open: &Self, close: &Self, time: f32) -> Self;

    /// The greatest absolute coordinate of points that bound it, or radius.
    #[doc(hidden)]
    #[must_use]
    fn greatest(&self) -> f32;
}

/// A primitive that moves in straight lines from `open` to `close`, as the shutter does.
///
/// At the time of a ray the hits are, bit for bit, those of the primitive [`Moves::between`] both.
///
/// ```
/// use canted_trace::{Intersect, Ray, RoundSegment};
/// use canted_wide::{Moving, WideBvh};
///
/// // A hair that falls from z = 4 to z = 0 and gets thicker.
/// let at = |z: f32, radius: f32| RoundSegment { ends: [[0.0, 0.0, z], [4.0, 0.0, z]], radii: [radius; 2] };
/// let bvh = WideBvh::over(vec![Moving { open: at(4.0, 0.5), close: at(0.0, 1.0) }])?;
/// let ray = Ray::new([2.0, 0.0, 10.0], [0.0, 0.0, -1.0]);
/// let hits = [0.0, 0.5, 1.0].map(|time| bvh.closest_hit(&ray.at_time(time)).map(|hit| hit.t));
/// assert_eq!(hits, [Some(5.5), Some(7.25), Some(9.0)]);
/// # Ok::<(), canted_wide::PrimitiveError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving<P> {
    /// As the shutter opens, time 0.
    pub open: P,
    /// As it closes, time 1.
    pub close: P,
}

mod sealed {
    pub trait Sealed {}
}

/// See the module.
const ROUNDING: f32 = 2.0 * f32::EPSILON;

impl<P: Moves> Moving<P> {
    /// More than roundings move what is between both ends.
    fn rounding(&self) -> f64 {
        f64::from(ROUNDING * self.open.greatest().max(self.close.greatest()) + f32::MIN_POSITIVE)
    }
}

impl<P: Moves> Primitive for Moving<P> {
    const ERROR: f32 = P::ERROR;
    const IS_LOCAL: bool = P::IS_LOCAL;
    // Without hulls for eight at once.
    const MAX_LEAF: usize = if P::MAX_LEAF > 2 { 2 } else { P::MAX_LEAF };
    // What is tested without a filter costs twice as much.
    const COST: f32 = if P::IS_HULL { 2.0 * P::COST } else { P::COST };

    fn bounds(&self) -> Aabb {
        let [a, b] = [self.open.bounds(), self.close.bounds()];
        // A union passes over NaN.
        if a.min[0].is_nan() || b.min[0].is_nan() {
            return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
        }
        let both = a.union(b);
        let rounding = self.rounding();
        Aabb {
            min: both.min.map(|x| down(f64::from(x) - rounding)),
            max: both.max.map(|x| up(f64::from(x) + rounding)),
        }
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        let [a, b] = [self.open.extent_along(direction), self.close.extent_along(direction)];
        let rounding = self.rounding();
        [down(f64::from(a[0].min(b[0])) - rounding), up(f64::from(a[1].max(b[1])) + rounding)]
    }

    fn moments(&self) -> Moments {
        self.open.moments().merged(&self.close.moments())
    }

    #[inline(always)]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        P::between(&self.open, &self.close, ray.time).intersect(ray, t_max)
    }
}

impl<P: Moves + SavedPrimitive> SavedPrimitive for Moving<P> {
    /// The numbers at both ends.
    type Data = [P::Data; 2];

    fn to_data(&self) -> Self::Data {
        [self.open.to_data(), self.close.to_data()]
    }

    fn from_data([open, close]: &Self::Data) -> Self {
        Self { open: P::from_data(open), close: P::from_data(close) }
    }
}

/// The greatest absolute number.
fn greatest(points: &[[f32; 3]], radii: &[f32]) -> f32 {
    points.as_flattened().iter().chain(radii).fold(0.0, |greatest, x| greatest.max(x.abs()))
}

/// Points at a time.
#[inline(always)]
fn points_at<const N: usize>(open: &[[f32; 3]; N], close: &[[f32; 3]; N], time: f32) -> [[f32; 3]; N] {
    let mut points = *open;
    for (point, close) in points.iter_mut().zip(close) {
        *point = numbers_at(point, close, time);
    }
    points
}

impl sealed::Sealed for Sphere {}

impl Moves for Sphere {
    fn greatest(&self) -> f32 {
        greatest(&[self.center], &[self.radius])
    }

    #[inline(always)]
    fn between(open: &Self, close: &Self, time: f32) -> Self {
        let [radius] = numbers_at(&[open.radius], &[close.radius], time);
        Self { center: numbers_at(&open.center, &close.center, time), radius }
    }
}

impl sealed::Sealed for RoundSegment {}

impl Moves for RoundSegment {
    fn greatest(&self) -> f32 {
        greatest(&self.ends, &self.radii)
    }

    #[inline(always)]
    fn between(open: &Self, close: &Self, time: f32) -> Self {
        Self { ends: points_at(&open.ends, &close.ends, time), radii: numbers_at(&open.radii, &close.radii, time) }
    }
}

impl sealed::Sealed for RoundCubic {}

impl Moves for RoundCubic {
    fn greatest(&self) -> f32 {
        greatest(&self.points, &self.radii)
    }

    #[inline(always)]
    fn between(open: &Self, close: &Self, time: f32) -> Self {
        Self {
            points: points_at(&open.points, &close.points, time),
            radii: numbers_at(&open.radii, &close.radii, time),
        }
    }
}

impl sealed::Sealed for RibbonSegment {}

impl Moves for RibbonSegment {
    fn greatest(&self) -> f32 {
        greatest(&self.ends, &self.radii)
    }

    #[inline(always)]
    fn between(open: &Self, close: &Self, time: f32) -> Self {
        Self {
            ends: points_at(&open.ends, &close.ends, time),
            radii: numbers_at(&open.radii, &close.radii, time),
            next: numbers_at(&open.next, &close.next, time),
        }
    }
}

impl sealed::Sealed for RibbonCubic {}

impl Moves for RibbonCubic {
    fn greatest(&self) -> f32 {
        greatest(&self.points, &self.radii)
    }

    #[inline(always)]
    fn between(open: &Self, close: &Self, time: f32) -> Self {
        Self {
            points: points_at(&open.points, &close.points, time),
            radii: numbers_at(&open.radii, &close.radii, time),
            next: numbers_at(&open.next, &close.next, time),
        }
    }
}

impl sealed::Sealed for BezierPatch {}

impl Moves for BezierPatch {
    fn greatest(&self) -> f32 {
        greatest(self.points.as_flattened(), &[])
    }

    #[inline(always)]
    fn between(open: &Self, close: &Self, time: f32) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (&open.points, &close.points);
        Self { points: [points_at(a, e, time), points_at(b, f, time), points_at(c, g, time), points_at(d, h, time)] }
    }
}
