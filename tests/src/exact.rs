//! Boxes, rays and transforms in exact arithmetic.
//!
//! Every finite `f32` is an integer multiple of 2^-149, so geometry is computed on integers in that unit (see [`in_units`]).
//! A product of `n` coordinates has the unit 2^(-149 n); both sides of a comparison are converted to the same unit.

use canted_obb::{Affine, Obb};
use canted_trace::Ray;
use num_bigint::BigInt;

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
}
