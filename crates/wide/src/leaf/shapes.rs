//! Spheres and boxes, and intervals that contain projections, rounded outward.
//!
//! # Error
//! Let u = 2^-53. Products of two f32 are exact in f64. The sum of three is off by at most 2.01 u·Σ|terms|, the length of a
//! direction by 2.1 u, its product with a radius by 3.2 u, and the end of the interval by one more rounding: in all less
//! than 4.3 u·(Σ|terms| + r·|d|), so [`EXTENT_ERROR`] covers it, its own rounding and that of its subtraction.

use canted_obb::Aabb;
use canted_obb::round::{down, up};
use canted_trace::{ReferencePoint, ScaledRay, Side, Sphere};

use super::{Primitive, PrimitiveHit, SavedPrimitive};
use crate::build::item::Placed;

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

/// See the module.
const EXTENT_ERROR: f64 = 4.0 * f64::EPSILON;

/// The interval of `direction·x` over all points within `radius` of `points`, of their convex hull too; rounded outward.
///
/// One point makes a sphere, two a capsule, four a flat or solid shape. No points give the empty interval.
#[must_use]
pub fn extent_of_points(points: impl IntoIterator<Item = [f32; 3]>, radius: f32, direction: [f32; 3]) -> [f32; 2] {
    let d = direction.map(f64::from);
    let reach = f64::from(radius) * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    let (mut lo, mut hi) = (f64::MAX, f64::MIN);
    for point in points {
        let terms: [f64; 3] = std::array::from_fn(|k| d[k] * f64::from(point[k]));
        let at = terms[0] + terms[1] + terms[2];
        let error = EXTENT_ERROR * (terms[0].abs() + terms[1].abs() + terms[2].abs() + reach);
        lo = lo.min(at - reach - error);
        hi = hi.max(at + reach + error);
    }
    [down(lo), up(hi)]
}

/// The interval of `direction·x` over a box, rounded outward.
#[must_use]
pub fn extent_of_box(aabb: &Aabb, direction: [f32; 3]) -> [f32; 2] {
    let ends = |least: bool| {
        // The corner that is farthest along the direction, or against it.
        let corner = std::array::from_fn(|k| if (direction[k] < 0.0) == least { aabb.max[k] } else { aabb.min[k] });
        extent_of_points([corner], 0.0, direction)
    };
    [ends(true)[0], ends(false)[1]]
}

/// The box around all points within `radius` of `points`, rounded outward; [`Aabb::EMPTY`] for none, and NaN, which builds
/// reject, where a coordinate is NaN.
#[must_use]
pub fn bounds_of_points(points: impl IntoIterator<Item = [f32; 3]>, radius: f32) -> Aabb {
    let mut has_nan = false;
    let aabb = Aabb::from_points(points.into_iter().inspect(|point| has_nan |= point.iter().any(|x| x.is_nan())));
    if has_nan {
        return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
    }
    if aabb.is_empty() {
        return aabb;
    }
    Aabb { min: aabb.min.map(|x| -sum_up(-x, radius)), max: aabb.max.map(|x| sum_up(x, radius)) }
}

/// The intervals along these rows around several primitives, rounded outward: least and greatest projections; empty for no
/// primitive.
///
/// Each interval is the intersection of the primitive's own with that of its bounds: where a primitive reports NaN or too
/// wide an interval, that of its bounds remains. So no projection exceeds those of the bounds, as the proof requires. Relative to a
/// reference point, bounds are rounded to nearest ([`ReferencePoint::ROUNDING`](canted_trace::ReferencePoint::ROUNDING)), own intervals outward.
pub(crate) fn extents_within<'a, P: Primitive + 'a, const N: usize>(
    rows: &[[f32; 3]; N],
    primitives: impl IntoIterator<Item = Placed<'a, P>>,
) -> [[f32; N]; 2] {
    let (mut lo, mut hi) = ([f32::MAX; N], [f32::MIN; N]);
    for Placed { primitive, reference } in primitives {
        let bounds = reference.moved_box(&primitive.bounds());
        for k in 0..N {
            let own = moved_extent(primitive.extent_along(rows[k]), rows[k], reference);
            let of_bounds = extent_of_box(&bounds, rows[k]);
            // The minimum or maximum of NaN and a number is the number.
            lo[k] = lo[k].min(of_bounds[0].max(own[0]));
            hi[k] = hi[k].max(of_bounds[1].min(own[1]));
        }
    }
    [lo, hi]
}

/// An interval along `direction`, relative to a point; rounded outward.
fn moved_extent([lo, hi]: [f32; 2], direction: [f32; 3], reference: ReferencePoint) -> [f32; 2] {
    if reference.is_origin() {
        return [lo, hi];
    }
    let terms: [f64; 3] = std::array::from_fn(|k| f64::from(direction[k]) * f64::from(reference.point()[k]));
    let at = terms[0] + terms[1] + terms[2];
    let (lo, hi) = (f64::from(lo), f64::from(hi));
    let error = EXTENT_ERROR * (terms[0].abs() + terms[1].abs() + terms[2].abs() + lo.abs().max(hi.abs()));
    [down(lo - at - error), up(hi - at + error)]
}

/// An f32 that is not below the real number `a + b`.
fn sum_up(a: f32, b: f32) -> f32 {
    let (a, b) = (f64::from(a), f64::from(b));
    let sum = a + b;
    // The rounding error of the sum (Knuth 1969).
    let b_part = sum - a;
    let error = (a - (sum - b_part)) + (b - b_part);
    up(if error > 0.0 { sum.next_up() } else { sum })
}
