//! Spheres and boxes as primitives.

use canted_obb::Aabb;
use canted_trace::{ScaledRay, Side, Sphere};

use super::extents::{bounds_of_points, extent_of_points};
use super::primitive::{Primitive, PrimitiveHit, SavedPrimitive};

/// Front where the ray enters, back where it leaves; surface coordinates are 0.
///
/// # Error
/// Let u = 2^-24 and `S` the greatest `|x - o|∞` of points of the bounds, which exceeds the radius. The roots are computed in f64 from
/// the difference of center and origin: an error of some 2^-50·S in the vector from the center to the line moves the point from the sphere by as much; one of
/// the chord's square, of some 2^-50 relative, moves it along the line and from the sphere by less. Rounding `t` adds
/// u·S: 1.1 u of the 20 u that are stated.
impl Primitive for Sphere {
    const IS_LOCAL: bool = true;

    fn bounds(&self) -> Aabb {
        bounds_of_points([self.center], self.radius)
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_points([self.center], self.radius, direction)
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        entry_or_exit(self.roots_scaled(ray)?, ray.t_min, t_max)
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
        if near <= far { entry_or_exit([near as f32 + 0.0, far as f32 + 0.0], ray.t_min, t_max) } else { None }
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

/// The first of the two in the interval.
#[inline]
fn entry_or_exit([entry, exit]: [f32; 2], t_min: f32, t_max: f32) -> Option<PrimitiveHit> {
    let (t, side) = if entry >= t_min { (entry, Side::Front) } else { (exit, Side::Back) };
    (t_min <= t && t <= t_max).then_some(PrimitiveHit { t, u: 0.0, v: 0.0, side })
}
