//! Rays, boxes and triangles in exact fractions, for results that need a quotient.

use canted_obb::{Aabb, Obb};
use canted_trace::Ray;
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};

use crate::exact::{UNIT_BITS, abs, cross, dot, in_units, plane, point, sub};

/// Whether a ray hits a box within its closed interval; never for a singular frame.
#[must_use]
pub fn intersects_box(ray: &Ray, obb: &Obb) -> bool {
    BoxEntry::of(ray, obb).is_some()
}

/// The exact point at which a ray enters a box.
#[derive(Clone, Debug)]
pub struct BoxEntry {
    /// The least `t` of the ray's interval inside the box, in units of the direction.
    pub t: BigRational,
}

impl BoxEntry {
    /// The entry of a ray that hits the box within its closed interval; `None` for a singular frame.
    #[must_use]
    pub fn of(ray: &Ray, obb: &Obb) -> Option<Self> {
        let frame = obb.frame.map(point);
        let determinant = abs(dot(&frame[0], &cross(&frame[1], &frame[2])));
        if determinant.is_zero() {
            return None;
        }
        let offset = sub(&point(ray.origin), &point(obb.center));
        let direction = point(ray.direction);
        let slab = |k: usize| {
            let row = cross(&frame[(k + 1) % 3], &frame[(k + 2) % 3]);
            // All three in units of 2^(-149·3); the half-extent is multiplied by 2^149.
            let (start, rate) = (dot(&row, &offset) << UNIT_BITS, dot(&row, &direction) << UNIT_BITS);
            let half = in_units(obb.half_extents[k]) * &determinant;
            ([-&half - &start, half - start], rate)
        };
        Self::within(ray, slab)
    }

    /// The same for an axis-aligned box; rays never enter an empty one.
    #[must_use]
    pub fn of_aabb(ray: &Ray, aabb: &Aabb) -> Option<Self> {
        let [min, max] = [aabb.min, aabb.max].map(point);
        let (origin, direction) = (point(ray.origin), point(ray.direction));
        let slab = |k: usize| ([&min[k] - &origin[k], &max[k] - &origin[k]], direction[k].clone());
        Self::within(ray, slab)
    }

    /// Clips a ray's interval to three slabs, each given by its bounds relative to the origin and the ray's speed across it.
    fn within(ray: &Ray, slab: impl Fn(usize) -> ([BigInt; 2], BigInt)) -> Option<Self> {
        let mut first = number(ray.t_min);
        let mut last = ray.t_max.is_finite().then(|| number(ray.t_max));
        for k in 0..3 {
            let ([low, high], rate) = slab(k);
            if low > high {
                return None;
            }
            if rate.is_zero() {
                if low.is_positive() || high.is_negative() {
                    return None;
                }
                continue;
            }
            let ends = [low, high].map(|end| BigRational::new(end, rate.clone()));
            let [near, far] = if ends[0] <= ends[1] { ends } else { [ends[1].clone(), ends[0].clone()] };
            first = first.max(near);
            last = Some(last.map_or_else(|| far.clone(), |last| last.min(far.clone())));
        }
        last.is_none_or(|last| first <= last).then_some(Self { t: first })
    }

    /// Whether the ray starts before the entry.
    #[must_use]
    pub fn is_behind_start(&self, ray: &Ray) -> bool {
        self.t > number(ray.t_min)
    }

    /// Error of `t` in units in the last place of the true value; NaN if that exceeds the range of `f32`.
    #[must_use]
    pub fn error_ulps(&self, t: f32) -> f64 {
        distance(t, &self.t) / ulp(&self.t)
    }
}

/// A number as a fraction.
fn number(x: f32) -> BigRational {
    BigRational::new(in_units(x), BigInt::from(1) << UNIT_BITS)
}

/// Absolute error of a number; infinite if it is not finite.
fn distance(found: f32, truth: &BigRational) -> f64 {
    if found.is_finite() { (number(found) - truth).to_f64().unwrap_or(f64::NAN).abs() } else { f64::INFINITY }
}

/// The unit in the last place of the rounded value.
#[expect(clippy::cast_possible_truncation, reason = "the unit in the last place is that of the rounded value")]
fn ulp(truth: &BigRational) -> f64 {
    let truth = (truth.to_f64().unwrap_or(f64::NAN) as f32).abs();
    f64::from(truth.next_up()) - f64::from(truth)
}

/// The exact intersection of a ray's line with a triangle's plane.
#[derive(Clone, Debug)]
pub struct Piercing {
    /// Distance in units of the direction, then the barycentric weights of the second and third vertex.
    pub tuv: [BigRational; 3],
}

impl Piercing {
    /// `None` if the line is parallel to the plane.
    #[must_use]
    pub fn of(ray: &Ray, corners: [[f32; 3]; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(point);
        let (e1, e2) = (sub(&b, &a), sub(&c, &a));
        let (direction, offset) = (point(ray.direction), sub(&point(ray.origin), &a));
        let p = cross(&direction, &e2);
        let q = cross(&offset, &e1);
        let determinant = dot(&p, &e1);
        // All are products of three lengths, so in one unit.
        let over = |x: BigInt| BigRational::new(x, determinant.clone());
        (!determinant.is_zero())
            .then(|| Self { tuv: [over(dot(&q, &e2)), over(dot(&p, &offset)), over(dot(&q, &direction))] })
    }

    /// Whether the point is in the triangle, including its edges, and in the ray's interval.
    #[must_use]
    pub fn is_hit(&self, ray: &Ray) -> bool {
        let [t, u, v] = &self.tuv;
        let one = BigRational::from_integer(BigInt::from(1));
        !u.is_negative()
            && !v.is_negative()
            && u + v <= one
            && *t >= number(ray.t_min)
            && (ray.t_max == f32::INFINITY || *t <= number(ray.t_max))
    }

    /// Errors of `t`, `u`, `v`: `t` in units in the last place of the true value, weights in those of one half.
    #[must_use]
    pub fn error_ulps(&self, tuv: [f32; 3]) -> [f64; 3] {
        let weight_ulp = f64::from(f32::EPSILON) / 2.0;
        std::array::from_fn(|k| {
            let ulp = if k == 0 { ulp(&self.tuv[0]) } else { weight_ulp };
            distance(tuv[k], &self.tuv[k]) / ulp
        })
    }
}

/// Distance of the point at `t` from the triangle's plane in scene units; infinite for a degenerate triangle.
#[must_use]
pub fn plane_distance(ray: &Ray, t: f32, corners: [[f32; 3]; 3]) -> f64 {
    let (normal, offset) = plane(&corners, &point(ray.origin));
    let square = dot(&normal, &normal);
    if square.is_zero() {
        return f64::INFINITY;
    }
    let distance = in_units(t) * dot(&normal, &point(ray.direction)) - (offset << UNIT_BITS);
    // The distance has the unit 2^(-149·4) and the normal 2^(-149·2); squared and divided they leave 2^(-149·4).
    let quotient = BigRational::new(&distance * &distance, square << (4 * UNIT_BITS));
    quotient.to_f64().unwrap_or(f64::INFINITY).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_closed_for_rays() {
        let obb = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0, 1.0, 0.0] };
        let along_z = |x: f32| Ray::new([x, 0.5, -2.0], [0.0, 0.0, 1.0]);
        assert!(intersects_box(&along_z(1.0), &obb) && !intersects_box(&along_z(1.0f32.next_up()), &obb));
        assert!(intersects_box(&Ray { t_max: 2.0, ..along_z(0.0) }, &obb));
        assert!(!intersects_box(&Ray { t_max: 2.0f32.next_down(), ..along_z(0.0) }, &obb));
        assert!(intersects_box(&Ray { t_min: 2.0, ..along_z(0.0) }, &obb));
        assert!(!intersects_box(&Ray { t_min: 2.0f32.next_up(), ..along_z(0.0) }, &obb));
        assert!(intersects_box(&Ray::new([-5.0, 1.0, 0.0], [1.0, 0.0, 0.0]), &obb), "in two faces at once");
        assert!(!intersects_box(&Ray::new([0.0; 3], [1.0; 3]), &Obb { frame: [[1.0; 3]; 3], ..obb }));
    }

    #[test]
    fn entries_are_exact_and_errors_are_in_ulps() {
        let obb = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [1.0, 1.0, 0.5] };
        let ray = Ray::new([0.5, 0.5, -2.0], [0.0, 0.0, 2.0]);
        let entry = BoxEntry::of(&ray, &obb).unwrap();
        assert!(entry.is_behind_start(&ray));
        assert_eq!([0.75, 0.75f32.next_up(), 0.75f32.next_down()].map(|t| entry.error_ulps(t)), [0.0, 1.0, 1.0]);
        // A slower ray enters beyond the range of f32.
        let slow = Ray { direction: [0.0, 0.0, 2e-39], ..ray };
        assert!(entry.error_ulps(f32::INFINITY) == f64::INFINITY);
        assert!(BoxEntry::of(&slow, &obb).unwrap().error_ulps(f32::INFINITY).is_nan());
        let inside = Ray { origin: [0.5, 0.5, 0.0], ..ray };
        assert!(!BoxEntry::of(&inside, &obb).unwrap().is_behind_start(&inside));
        assert!(BoxEntry::of(&Ray { origin: [2.0, 0.0, -2.0], ..ray }, &obb).is_none());
        // One third is not representable, so no half-extent gives exactly this box.
        let aabb = Aabb { min: [0.0, 0.0, -0.1], max: [1.0, 1.0, 1.0 / 3.0] };
        let entry = |origin: [f32; 3]| BoxEntry::of_aabb(&Ray { origin, direction: [1.0, 0.0, 0.0], ..ray }, &aabb);
        assert_eq!(entry([-1.0, 1.0, 1.0 / 3.0]).unwrap().error_ulps(1.0), 0.0);
        assert!(
            entry([-1.0, 1.0, (1.0f32 / 3.0).next_up()]).is_none()
                && entry([-1.0, 1.0, (-0.1f32).next_down()]).is_none()
        );
        assert!(BoxEntry::of_aabb(&ray, &Aabb::EMPTY).is_none());
    }

    #[test]
    fn plane_hits_are_exact_and_errors_are_in_ulps() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let ray = Ray::new([2.0, 1.0, -2.0], [0.0, 0.0, 2.0]);
        let found = Piercing::of(&ray, corners).unwrap();
        assert!(found.is_hit(&ray) && !found.is_hit(&Ray { t_max: 1.5f32.next_down(), ..ray }));
        assert_eq!(found.error_ulps([1.5, 0.5, 0.25]), [0.0; 3]);
        assert_eq!(found.error_ulps([1.5f32.next_up(), 0.5f32.next_down(), 0.25]), [1.0, 0.5, 0.0]);
        let outside = Ray::new([2.0, 2.0f32.next_up(), -2.0], [0.0, 0.0, 2.0]);
        assert!(!Piercing::of(&outside, corners).unwrap().is_hit(&outside));
        assert!(Piercing::of(&Ray::new([0.0; 3], [1.0, 0.0, 0.0]), corners).is_none());
    }

    #[test]
    fn distances_from_planes_are_lengths() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let ray = Ray::new([1.0, 1.0, 0.0], [0.0, 0.0, 2.0]);
        assert_eq!(plane_distance(&ray, 0.5, corners), 0.0);
        assert_eq!(plane_distance(&ray, 2.0, corners), 3.0);
        let tiny = corners.map(|corner| corner.map(|x| x * 2.0f32.powi(-60)));
        let from = Ray { origin: ray.origin.map(|x| x * 2.0f32.powi(-60)), ..ray };
        assert_eq!(plane_distance(&from, 0.0, tiny), 2.0f64.powi(-60));
        assert_eq!(plane_distance(&ray, 0.0, [[1.0; 3]; 3]), f64::INFINITY);
    }
}
