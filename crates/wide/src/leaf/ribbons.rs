//! Ribbons that face the ray as primitives.
//!
//! # Error
//! Let `S` be the greatest `|x - o|∞` of points of the bounds. A hit at the parameter `u` is reported only if the distance between line and center, computed in
//! f64 from the difference of center and origin, is at most the radius there: but for some 2^-48·S the point of the line next to the center
//! is in the ball around it, and the bounds contain all balls. Rounding `t` moves the point by 2^-24·S along the ray: less than two units of the 20
//! that are stated.

use canted_obb::{Aabb, Moments};
use canted_trace::{RibbonCubic, RibbonPoint, RibbonSegment, RoundCubic, RoundSegment, ScaledRay, Side};

use super::primitive::{FourBalls, Primitive, PrimitiveHit, SavedPrimitive};
use super::shapes::{balls_of_cubic, balls_of_segment};

/// The tube with the same silhouette.
fn segment_around(ribbon: &RibbonSegment) -> RoundSegment {
    RoundSegment { ends: ribbon.ends, radii: ribbon.radii }
}

/// The tube with the same silhouette.
fn cubic_around(ribbon: &RibbonCubic) -> RoundCubic {
    RoundCubic { points: ribbon.points, radii: ribbon.radii }
}

/// A ribbon has no inside: every hit is of its front.
fn front(RibbonPoint { t, u, v }: RibbonPoint) -> PrimitiveHit {
    PrimitiveHit { t, u, v, side: Side::Front }
}

/// `u` is the position along the ribbon, `v` the one across, each from 0 to 1; every hit is of the front.
impl Primitive for RibbonSegment {
    const IS_LOCAL: bool = true;
    const MAX_LEAF: usize = 8;
    const COST: f32 = 6.0;
    const HULL: Option<fn(&Self) -> RoundSegment> = Some(segment_around);
    const FIT_BALLS: Option<fn(&Self) -> FourBalls> = Some(|ribbon| balls_of_segment(&segment_around(ribbon)));

    fn bounds(&self) -> Aabb {
        if !self.next.iter().all(|x| x.is_finite()) {
            return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
        }
        segment_around(self).bounds()
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        segment_around(self).extent_along(direction)
    }

    fn moments(&self) -> Moments {
        segment_around(self).moments()
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let point = self.point_scaled(ray)?;
        (ray.t_min <= point.t && point.t <= t_max).then(|| front(point))
    }
}

impl SavedPrimitive for RibbonSegment {
    /// Both ends, each with half the width, then the point of the next ribbon and 0.
    type Data = [[f32; 4]; 3];

    fn to_data(&self) -> Self::Data {
        let ([a, b], [x, y, z]) = (segment_around(self).to_data(), self.next);
        [a, b, [x, y, z, 0.0]]
    }

    fn from_data(&[a, b, [x, y, z, _]]: &Self::Data) -> Self {
        let RoundSegment { ends, radii } = RoundSegment::from_data(&[a, b]);
        Self { ends, radii, next: [x, y, z] }
    }
}

/// `u` is the parameter of the center line, `v` the position across, each from 0 to 1; every hit is of the front. The first of several hits in the interval
/// counts.
impl Primitive for RibbonCubic {
    const IS_LOCAL: bool = true;
    const MAX_LEAF: usize = 1;
    const COST: f32 = 20.0;
    const FIT_BALLS: Option<fn(&Self) -> FourBalls> = Some(|ribbon| balls_of_cubic(&cubic_around(ribbon)));

    fn bounds(&self) -> Aabb {
        if !self.next.iter().all(|x| x.is_finite()) {
            return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
        }
        cubic_around(self).bounds()
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        cubic_around(self).extent_along(direction)
    }

    fn moments(&self) -> Moments {
        cubic_around(self).moments()
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        self.point_scaled(ray, t_max).map(front)
    }
}

impl SavedPrimitive for RibbonCubic {
    /// The control points, each with half the width, then the point of the next ribbon and 0.
    type Data = [[f32; 4]; 5];

    fn to_data(&self) -> Self::Data {
        let ([a, b, c, d], [x, y, z]) = (cubic_around(self).to_data(), self.next);
        [a, b, c, d, [x, y, z, 0.0]]
    }

    fn from_data(&[a, b, c, d, [x, y, z, _]]: &Self::Data) -> Self {
        let RoundCubic { points, radii } = RoundCubic::from_data(&[a, b, c, d]);
        Self { points, radii, next: [x, y, z] }
    }
}
