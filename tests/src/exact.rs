//! Boxes, rays, triangles and transforms in exact arithmetic.
//!
//! Every finite `f32` is an integer multiple of 2^-149, so geometry is computed on integers in that unit (see [`in_units`]).
//! A product of `n` coordinates has the unit 2^(-149 n); both sides of a comparison are converted to the same unit. Results that need a
//! quotient are fractions.

use canted_obb::{Aabb, Affine, Obb};
use canted_trace::Ray;
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};

/// Fractional bits of the unit 2^-149.
pub(crate) const UNIT_BITS: u32 = 149;

pub(crate) type Point = [BigInt; 3];

/// `x` in units of 2^-149.
///
/// # Panics
/// Panics if `x` is not finite.
#[must_use]
pub fn in_units(x: f32) -> BigInt {
    assert!(x.is_finite(), "{x} is not finite");
    let exponent = x.to_bits() >> 23 & 0xff;
    let fraction = x.to_bits() & 0x7f_ffff;
    let magnitude = match exponent {
        0 => BigInt::from(fraction),
        _ => BigInt::from(fraction | 1 << 23) << (exponent - 1),
    };
    if x.is_sign_negative() { -magnitude } else { magnitude }
}

pub(crate) fn point(p: [f32; 3]) -> Point {
    p.map(in_units)
}

pub(crate) fn sub(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|k| &a[k] - &b[k])
}

pub(crate) fn cross(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|k| &a[(k + 1) % 3] * &b[(k + 2) % 3] - &a[(k + 2) % 3] * &b[(k + 1) % 3])
}

pub(crate) fn dot(a: &Point, b: &Point) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

pub(crate) fn abs(x: BigInt) -> BigInt {
    if x < BigInt::ZERO { -x } else { x }
}

/// Whether `p` is `center + frame · q` with `|q| <= half`, by Cramer's rule; a singular frame contains nothing.
#[must_use]
pub fn contains(obb: &Obb, p: [f32; 3]) -> bool {
    let frame = obb.frame.map(point);
    let offset = sub(&point(p), &point(obb.center));
    let determinant = abs(dot(&frame[0], &cross(&frame[1], &frame[2])));
    determinant > BigInt::ZERO
        && (0..3).all(|k| {
            let numerator = abs(dot(&cross(&frame[(k + 1) % 3], &frame[(k + 2) % 3]), &offset));
            numerator << UNIT_BITS <= in_units(obb.half_extents[k]) * &determinant
        })
}

/// Whether `obb` contains all corners of `inner`; a singular frame contains nothing.
#[must_use]
pub fn contains_box(obb: &Obb, inner: &Obb) -> bool {
    let frame = obb.frame.map(point);
    let offset = sub(&point(inner.center), &point(obb.center));
    let determinant = abs(dot(&frame[0], &cross(&frame[1], &frame[2])));
    determinant > BigInt::ZERO
        && (0..3).all(|k| {
            let cofactors = cross(&frame[(k + 1) % 3], &frame[(k + 2) % 3]);
            let sides = inner.frame.iter().zip(inner.half_extents);
            let support: BigInt = sides.map(|(axis, half)| abs(dot(&cofactors, &point(*axis))) * in_units(half)).sum();
            (abs(dot(&cofactors, &offset)) << UNIT_BITS) + support <= in_units(obb.half_extents[k]) * &determinant
        })
}

/// Result of a ray-triangle test in which each vertex may be displaced by a margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The ray hits the triangle for every displacement.
    Pierced,
    /// The ray misses the triangle for every displacement.
    Missed,
    /// The result depends on the displacement.
    Open,
}

/// Margins of a verdict, in scene units.
#[derive(Clone, Copy, Debug)]
pub struct Margin {
    /// Greatest displacement of a vertex across the ray, seen along the ray's greatest axis.
    pub across: f32,
    /// Greatest distance of the reported point from the triangle's plane.
    pub along: f32,
}

/// Classifies a ray with `t_min = 0` and no end.
///
/// Seen along the ray, the vertices are points of a plane and the ray is the origin. If it is inside the triangle or beyond
/// an edge by more than the margin, the same holds for every triangle with vertices that close.
#[must_use]
pub fn verdict(ray: &Ray, corners: [[f32; 3]; 3], margin: &Margin) -> Verdict {
    let (origin, direction) = (point(ray.origin), point(ray.direction));
    let z = (0..3).fold(0, |best, k| if ray.direction[k].abs() > ray.direction[best].abs() { k } else { best });
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    // Sheared along the ray and multiplied by its greatest component, so that no division is needed.
    let seen = corners.map(|corner| {
        let a = sub(&point(corner), &origin);
        [x, y].map(|k| &a[k] * &direction[z] - &direction[k] * &a[z])
    });
    let reach = in_units(margin.across) * &direction[z];
    let edges: [(BigInt, BigInt); 3] = std::array::from_fn(|i| {
        let (p, q) = (&seen[i], &seen[(i + 1) % 3]);
        let (e_x, e_y) = (&q[0] - &p[0], &q[1] - &p[1]);
        let side = &p[0] * &q[1] - &p[1] * &q[0];
        (side, &e_x * &e_x + &e_y * &e_y)
    });
    let area: BigInt = edges.iter().map(|(side, _)| side).sum();
    let clear = |(side, edge): &(BigInt, BigInt)| side * side > &reach * &reach * edge;
    let inward = |(side, _): &(BigInt, BigInt)| side * &area > BigInt::ZERO;
    if edges.iter().any(|edge| clear(edge) && !inward(edge)) {
        return Verdict::Missed;
    }
    let (normal, offset) = plane(&corners, &origin);
    let rate = dot(&normal, &direction);
    let depth = in_units(margin.along) * in_units(margin.along) * dot(&normal, &normal);
    let off_plane = &offset * &offset > depth;
    match (off_plane, edges.iter().all(|edge| clear(edge) && inward(edge)), &offset * &rate > BigInt::ZERO) {
        (true, true, true) => Verdict::Pierced,
        (true, _, false) => Verdict::Missed,
        _ => Verdict::Open,
    }
}

/// Whether the point at `t` lies within `along` of the triangle's plane.
#[must_use]
pub fn near_plane(ray: &Ray, t: f32, corners: [[f32; 3]; 3], along: f32) -> bool {
    let (normal, offset) = plane(&corners, &point(ray.origin));
    let rate = dot(&normal, &point(ray.direction));
    let distance = in_units(t) * rate - (offset << UNIT_BITS);
    let reach = in_units(along) << UNIT_BITS;
    &distance * &distance <= &reach * &reach * dot(&normal, &normal)
}

/// An unnormalized normal, and its dot product with the vector from `origin` to the plane.
pub(crate) fn plane(corners: &[[f32; 3]; 3], origin: &Point) -> (Point, BigInt) {
    let [a, b, c] = corners.map(point);
    let normal = cross(&sub(&b, &a), &sub(&c, &a));
    let offset = dot(&normal, &sub(&a, origin));
    (normal, offset)
}

/// Whether `p_object` is the exact inverse image of `p_world` with each component rounded once, and off by at most 2^-24 of
/// itself plus 2^-`slack_bits` of `size`.
#[must_use]
pub fn is_inverse_image(
    world_from_object: &Affine,
    p_world: [f32; 3],
    p_object: [f32; 3],
    size: f32,
    slack_bits: u32,
) -> bool {
    let [a, b, c, shift] = world_from_object.columns.map(point);
    let offset = sub(&point(p_world), &shift);
    let determinant = dot(&a, &cross(&b, &c));
    let rows = [cross(&b, &c), cross(&c, &a), cross(&a, &b)];
    (0..3).all(|k| {
        // In units of 2^(-149·4), times 2^(24 + slack_bits).
        let exact = dot(&rows[k], &offset) << UNIT_BITS;
        let error = abs(in_units(p_object[k]) * &determinant - &exact) << (24 + slack_bits);
        error <= (abs(exact) << slack_bits) + (abs(in_units(size) * &determinant) << 24)
    })
}

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
        // No hit has a `t` that is not finite.
        let mut last = number(ray.t_max.min(f32::MAX));
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
            last = last.min(far);
        }
        (first <= last).then_some(Self { t: first })
    }

    /// Whether the ray starts before the entry.
    #[must_use]
    pub fn is_behind_start(&self, ray: &Ray) -> bool {
        self.t > number(ray.t_min)
    }

    /// Error of `t` in units in the last place of the true value.
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
            && *t <= number(ray.t_max.min(f32::MAX))
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
    fn values_are_integer_multiples_of_the_unit() {
        assert_eq!(in_units(f32::from_bits(1)), BigInt::from(1));
        assert_eq!(in_units(-1.5), -(BigInt::from(3) << 148u32));
        assert_eq!(in_units(f32::MIN_POSITIVE), BigInt::from(1) << 23u32);
        assert_eq!(in_units(-0.0), BigInt::ZERO);
    }

    #[test]
    fn boxes_are_closed() {
        let obb = Obb {
            center: [1.0; 3],
            frame: [[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 1.0]],
            half_extents: [2.0, 0.0, 1.0],
        };
        assert!(contains(&obb, [2.0, 2.0, 2.0]) && !contains(&obb, [2.0, 2.0, 2.0f32.next_up()]));
        assert!(!contains(&obb, [2.0f32.next_up(), 2.0, 1.0]));
        assert!(!contains(&Obb { frame: [[1.0; 3]; 3], ..obb }, [1.0; 3]));
    }

    #[test]
    fn boxes_contain_boxes_up_to_their_corners() {
        let outer = Obb { center: [1.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [2.0; 3] };
        let diamond = Obb {
            center: [1.0; 3],
            frame: [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            half_extents: [1.0; 3],
        };
        assert!(contains_box(&outer, &outer) && contains_box(&outer, &diamond));
        assert!(!contains_box(&outer, &Obb { half_extents: [1.0f32.next_up(), 1.0, 1.0], ..diamond }));
        assert!(!contains_box(&outer, &Obb { center: [1.0, 1.0, 2.0f32.next_up()], ..diamond }));
    }

    #[test]
    fn verdicts_on_a_right_triangle() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let classify = |x: f32, across: f32, z: f32| {
            let ray = Ray::new([x, 1.0, 0.0], [0.0, 0.0, z]);
            verdict(&ray, corners, &Margin { across, along: 0.25 })
        };
        assert_eq!(classify(0.5, 0.25, 1.0), Verdict::Pierced);
        assert_eq!(classify(0.5, 0.25, -1.0), Verdict::Missed);
        assert_eq!([classify(0.25, 0.25, 3.0), classify(-0.25, 0.25, 3.0)], [Verdict::Open; 2]);
        assert_eq!(classify(-0.5, 0.25, 1.0), Verdict::Missed);
        let ray = Ray::new([0.5, 1.0, 0.0], [0.0, 0.0, 0.5]);
        assert!(near_plane(&ray, 2.0, corners, 0.0) && near_plane(&ray, 2.5, corners, 0.25));
        assert!(!near_plane(&ray, 2.5, corners, 0.249));
    }

    #[test]
    fn inverse_images_are_rounded_once() {
        let shear = Affine { columns: [[3.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]] };
        let third = 1.0 / 3.0f32;
        assert!(is_inverse_image(&shear, [2.0, 0.0, 0.0], [third, 0.0, 0.0], 1.0, 50));
        assert!(!is_inverse_image(&shear, [2.0, 0.0, 0.0], [third.next_down().next_down(), 0.0, 0.0], 1.0, 50));
    }

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
        // A slower ray would enter beyond the greatest finite `t`, where no ray hits.
        let slow = Ray { direction: [0.0, 0.0, 2e-39], ..ray };
        assert!(entry.error_ulps(f32::INFINITY) == f64::INFINITY);
        assert!(BoxEntry::of(&slow, &obb).is_none());
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
