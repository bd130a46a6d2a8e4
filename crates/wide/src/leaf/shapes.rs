//! Spheres, round segments, round cubic curves and boxes as primitives.

use canted_obb::{Aabb, Moments, Obb};
use canted_trace::{CurvePoint, RoundCubic, RoundSegment, ScaledRay, SegmentPoint, Side, Sphere};

use super::extents::{balls_of, bounds_of_points, extent_of_balls, extent_of_cubic, extent_of_points};
use super::primitive::{FourBalls, Primitive, PrimitiveHit, SavedPrimitive};

/// Front where the ray enters, back where it leaves; surface coordinates are 0.
///
/// # Error
/// Let u = 2^-24 and `S` the greatest `|x - o|∞` of points of the bounds, which exceeds the radius. The roots are computed in f64 from
/// the difference of center and origin: an error of some 2^-50·S in the vector from the center to the line moves the point from the sphere by as much; one of
/// the chord's square, of some 2^-50 of that of the radius, moves it from the sphere by half as much of the radius. Rounding `t` adds
/// u·S: 1.1 u of the 20 u that are stated.
impl Primitive for Sphere {
    const IS_LOCAL: bool = true;
    // Four filters of eight in a row take less than the nodes that they save.
    const MAX_LEAF: usize = 32;
    const COST: f32 = 0.5;
    const BALL: Option<fn(&Self) -> Sphere> = Some(|sphere| *sphere);
    const FIT_BALLS: Option<fn(&Self) -> FourBalls> = Some(|sphere| [sphere.to_data(); 4]);
    const IS_HULL: bool = true;

    fn bounds(&self) -> Aabb {
        bounds_of_points([self.center], self.radius)
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_points([self.center], self.radius, direction)
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        entry_or_exit(self.roots_scaled(ray)?.map(|t| (t, 0.0)), ray.t_min, t_max)
    }
}

impl SavedPrimitive for Sphere {
    type Data = [f32; 4];

    fn to_data(&self) -> [f32; 4] {
        let [x, y, z] = self.center;
        [x, y, z, self.radius]
    }

    fn from_data(&[x, y, z, radius]: &[f32; 4]) -> Self {
        Self { center: [x, y, z], radius }
    }
}

/// Front where the ray enters, back where it leaves; `u` is the position along the segment, `v` is 0.
///
/// # Error
/// Let `S` be the greatest `|x - o|∞` of points of the bounds: it exceeds half the length and the radii. The balls have the error of
/// [`Sphere`]. The quadratic form of the lateral surface is computed with an error of some 2^-48·a²·S² from terms of at most that
/// size, where `a` is the length of the segment, and its value at a distance `h` from a surface of the radius `r` is about `a²·h·(2r + h)`. So the computed root is off the
/// surface by `h <= sqrt(2^-48)·S`, less for thick segments. Rounding `t` adds u·S: two units in all of the 20 that are stated.
impl Primitive for RoundSegment {
    const IS_LOCAL: bool = true;
    const MAX_LEAF: usize = 8;
    const COST: f32 = 2.0;
    const HULL: Option<fn(&Self) -> RoundSegment> = Some(|segment| *segment);
    const FIT_BALLS: Option<fn(&Self) -> FourBalls> = Some(balls_of_segment);
    const IS_HULL: bool = true;

    fn bounds(&self) -> Aabb {
        let [a, b] = [0, 1].map(|end| bounds_of_points([self.ends[end]], self.radii[end]));
        // A union passes over NaN.
        if a.min[0].is_nan() {
            a
        } else if b.min[0].is_nan() {
            b
        } else {
            a.union(b)
        }
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_balls(&balls_of(&self.ends, &self.radii), direction)
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.ends)
    }

    #[inline(always)]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        entry_or_exit(self.first_scaled(ray)?.map(|SegmentPoint { t, u }| (t, u)), ray.t_min, t_max)
    }
}

impl SavedPrimitive for RoundSegment {
    /// Both ends, each with its radius.
    type Data = [[f32; 4]; 2];

    fn to_data(&self) -> Self::Data {
        [0, 1].map(|end| {
            let [x, y, z] = self.ends[end];
            [x, y, z, self.radii[end]]
        })
    }

    fn from_data(data: &Self::Data) -> Self {
        Self { ends: data.map(|[x, y, z, _]| [x, y, z]), radii: data.map(|[.., radius]| radius) }
    }
}

/// Front where the ray enters, back where it leaves; `u` is the parameter of the curve, `v` is 0.
///
/// # Error
/// Let `S` be the greatest `|x - o|∞` of points of the bounds. Where the search finds the entry or exit, it is off along the ray by at most 2^-30 of the distance and the
/// radius, together less than 3·S: by u/20 of `S`. Elsewhere the solid is made of round segments that deviate from the curve by at most 2^-22 of its size, which is at
/// most 2·S, or 2^-24 of the distance: by 8 u of `S`, and each has the error of [`RoundSegment`]. So ten units of the 20 that are stated cover both.
impl Primitive for RoundCubic {
    const IS_LOCAL: bool = true;
    const MAX_LEAF: usize = 1;
    const COST: f32 = 20.0;
    const FIT_BALLS: Option<fn(&Self) -> FourBalls> = Some(balls_of_cubic);

    fn bounds(&self) -> Aabb {
        if !self.points.as_flattened().iter().chain(&self.radii).all(|x| x.is_finite()) {
            return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
        }
        let (balls, mut bounds) = (balls_of(&self.points, &self.radii), Aabb::EMPTY);
        for k in 0..3 {
            [bounds.min[k], bounds.max[k]] = extent_of_cubic(&balls, Obb::IDENTITY_FRAME[k]);
        }
        bounds
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_cubic(&balls_of(&self.points, &self.radii), direction)
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.points)
    }

    #[inline(always)]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let CurvePoint { t, u, is_entry } = self.event_scaled(ray, t_max)?;
        Some(PrimitiveHit { t, u, v: 0.0, side: if is_entry { Side::Front } else { Side::Back } })
    }
}

/// Both ends, twice.
pub(super) fn balls_of_segment(segment: &RoundSegment) -> FourBalls {
    let [a, b] = segment.to_data();
    [a, b, a, b]
}

/// Ends, and the inner control balls of the halves that are next to the middle: as high as a curve whose bulge is a parabola.
pub(super) fn balls_of_cubic(curve: &RoundCubic) -> FourBalls {
    let [a, b, c, d] = curve.to_data();
    let mut balls = [a, b, c, d];
    for k in 0..4 {
        (balls[1][k], balls[2][k]) = (0.25 * a[k] + 0.5 * b[k] + 0.25 * c[k], 0.25 * b[k] + 0.5 * c[k] + 0.25 * d[k]);
    }
    balls
}

impl SavedPrimitive for RoundCubic {
    /// The control points, each with its radius.
    type Data = [[f32; 4]; 4];

    fn to_data(&self) -> Self::Data {
        [0, 1, 2, 3].map(|i| {
            let [x, y, z] = self.points[i];
            [x, y, z, self.radii[i]]
        })
    }

    fn from_data(data: &Self::Data) -> Self {
        Self { points: data.map(|[x, y, z, _]| [x, y, z]), radii: data.map(|[.., radius]| radius) }
    }
}

/// The surface of a box: front where the ray enters, back where it leaves; surface coordinates are 0.
///
/// A leaf holds one box, so [`WideBvh::traverse`](crate::WideBvh::traverse) reports the boxes that a ray enters.
///
/// # Error
/// Quotients of differences are computed in f64 and off by some 2^-52 relative, rounding `t` adds 2^-24·S, with S the greatest
/// `|x - o|∞` of points of the box: less than the 2 u that are stated.
impl Primitive for Aabb {
    const ERROR: f32 = f32::EPSILON;
    const IS_LOCAL: bool = true;
    const MAX_LEAF: usize = 1;

    fn bounds(&self) -> Aabb {
        *self
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            let [o, d, min, max] = [ray.origin[k], ray.direction[k], self.min[k], self.max[k]].map(f64::from);
            if d == 0.0 {
                if o < min || o > max {
                    return None;
                }
                continue;
            }
            let (a, b) = ((min - o) / d, (max - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        // Adding zero makes -0.0 positive.
        if near <= far { entry_or_exit([near, far].map(|t| (t as f32 + 0.0, 0.0)), ray.t_min, t_max) } else { None }
    }
}

impl SavedPrimitive for Aabb {
    /// Least coordinates, then greatest ones.
    type Data = [[f32; 3]; 2];

    fn to_data(&self) -> Self::Data {
        [self.min, self.max]
    }

    fn from_data(&[min, max]: &Self::Data) -> Self {
        Self { min, max }
    }
}

/// The first of two points, each with its `u`, in the interval.
#[inline]
pub(super) fn entry_or_exit([entry, exit]: [(f32, f32); 2], t_min: f32, t_max: f32) -> Option<PrimitiveHit> {
    let ((t, u), side) = if entry.0 >= t_min { (entry, Side::Front) } else { (exit, Side::Back) };
    (t_min <= t && t <= t_max).then_some(PrimitiveHit { t, u, v: 0.0, side })
}
