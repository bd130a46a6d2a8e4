//! Shapes that move along a segment, against the triangles of a BVH.
//!
//! A sphere touches a triangle when its center enters the set of points within the radius of it: a prism between two planes, a cylinder around each
//! edge and a ball around each vertex. The center enters the union where it enters the first of them, so the first contact is the least of seven roots.

use canted_obb::PrimId;
use canted_obb::round::up;
use canted_obb::vector::{Vector, add, cross, dot, length, scale, sub, to_f64};
use canted_trace::{Ray, Side, TrianglePoint, closest_to_zero};
use canted_wide::TriangleBvh;

/// How far a root may lie before the start and count as there, as a distance relative to coordinates: far more than roundings.
const START_ERROR: f64 = 1024.0 * f64::EPSILON;

/// The first contact of a sphere that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereContact {
    /// When the sphere touches, in units of the ray's direction: its center is then at `origin + t·direction`. `t_min` where it overlaps at the start.
    pub t: f64,
    /// The triangle. Of several at one `t` the lowest; at the start the nearest.
    pub primitive: PrimId,
    /// Barycentric coordinates of the second and third vertex of the point that is touched.
    pub uv: [f64; 2],
    /// The point of the triangle that is touched.
    pub position: [f64; 3],
    /// From the point that is touched to the center, of unit length; the normal of the triangle where the center is on it, zero if that has no area.
    pub normal: [f64; 3],
    /// The side of the triangle on which the center is.
    pub side: Side,
    /// Whether the sphere overlaps the triangle where it starts.
    pub starts_inside: bool,
}

/// The first contact of a sphere, whose center moves along a ray within its interval, with the triangles of a BVH; touching counts.
///
/// The answer is that of a loop over all triangles. `t` is computed in `f64`, with the error of a root: the center at `t` is off the radius by less than
/// 2^-40 of the distances of the triangle and of the center from the ray's origin, and of the radius. The sphere rests where the direction is zero. `None`
/// also for a radius that is negative or not finite, and for a ray that is not valid.
///
/// ```
/// use canted_collide::cast_sphere;
/// use canted_trace::Ray;
/// use canted_wide::TriangleBvh;
///
/// let floor = TriangleBvh::build(&[[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]], &[[0, 1, 2]])?;
/// let ball = cast_sphere(&floor, &Ray::new([1.0, 1.0, 5.0], [0.0, 0.0, -1.0]), 0.5).expect("the ball falls onto the floor");
/// assert_eq!((ball.t, ball.position, ball.normal), (4.5, [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]));
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[must_use]
pub fn cast_sphere(bvh: &TriangleBvh, ray: &Ray, radius: f64) -> Option<SphereContact> {
    let is_valid = radius >= 0.0
        && radius.is_finite()
        && ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite())
        && ray.t_min >= 0.0
        && ray.t_min <= ray.t_max
        && ray.t_min <= f32::MAX;
    if !is_valid {
        return None;
    }
    at_start(bvh, ray, radius).or_else(|| on_the_way(bvh, ray, radius))
}

/// The nearest triangle that the sphere overlaps where it starts.
fn at_start(bvh: &TriangleBvh, ray: &Ray, radius: f64) -> Option<SphereContact> {
    let center = ray.at(ray.t_min.into());
    let rounded = center.map(|x| x as f32);
    // The search is around the rounded center.
    let moved = length(sub(center, to_f64(rounded)));
    let bound = |reach: f64| (reach + moved) * (reach + moved) * (1.0 + 8.0 * f64::EPSILON);
    let mut nearest: Option<(f64, PrimId, [[f32; 3]; 3])> = None;
    bvh.visit_near(rounded, bound(radius), |primitive, vertices, limit| {
        let squared = closest_to(center, vertices).distance_squared;
        let is_nearer = nearest.is_none_or(|(least, lowest, _)| (squared, primitive) < (least, lowest));
        if squared > radius * radius || !is_nearer {
            return limit;
        }
        nearest = Some((squared, primitive, *vertices));
        bound(squared.sqrt())
    });
    nearest.map(|(_, primitive, vertices)| contact(ray, ray.t_min.into(), primitive, &vertices, true))
}

/// The first triangle that the sphere, which overlaps none at the start, comes to touch.
fn on_the_way(bvh: &TriangleBvh, ray: &Ray, radius: f64) -> Option<SphereContact> {
    let mut first: Option<(f64, PrimId, [[f32; 3]; 3])> = None;
    let end = f64::from(ray.t_max);
    bvh.visit_along(ray, radius, |primitive, vertices, t_max| {
        let Some(t) = first_contact(ray, vertices, radius).filter(|&t| t <= end) else { return t_max };
        if first.is_none_or(|(least, lowest, _)| (t, primitive) < (least, lowest)) {
            first = Some((t, primitive, *vertices));
            return up(t).max(0.0);
        }
        t_max
    });
    first.map(|(t, primitive, vertices)| contact(ray, t, primitive, &vertices, false))
}

fn contact(ray: &Ray, t: f64, primitive: PrimId, vertices: &[[f32; 3]; 3], starts_inside: bool) -> SphereContact {
    let center = ray.at(t);
    let closest = closest_to(center, vertices);
    let [a, b, c] = vertices.map(to_f64);
    let (ab, ac) = (sub(b, a), sub(c, a));
    let position = add(a, add(scale(ab, closest.u), scale(ac, closest.v)));
    let (to_center, across) = (sub(center, position), cross(ab, ac));
    let unit = |v: Vector| canted_obb::vector::normalized(v);
    let normal = unit(to_center).or_else(|| unit(across)).unwrap_or([0.0; 3]);
    let side = if dot(across, sub(center, a)) < 0.0 { Side::Back } else { Side::Front };
    SphereContact { t, primitive, uv: [closest.u, closest.v], position, normal, side, starts_inside }
}

fn closest_to(center: Vector, vertices: &[[f32; 3]; 3]) -> TrianglePoint {
    closest_to_zero(&vertices.map(|vertex| sub(to_f64(vertex), center)))
}

/// When a sphere that does not overlap the triangle at `t_min` first touches it.
fn first_contact(ray: &Ray, vertices: &[[f32; 3]; 3], radius: f64) -> Option<f64> {
    let (start, direction) = (ray.at(ray.t_min.into()), to_f64(ray.direction));
    // From the center where it starts.
    let [a, b, c] = vertices.map(|vertex| sub(to_f64(vertex), start));
    let mut first = f64::INFINITY;
    // A sphere that almost touches where it starts has a root just before it.
    let greatest = a.iter().chain(&b).chain(&c).fold(radius, |most, x| most.max(x.abs()));
    let earliest = -START_ERROR * greatest / length(direction);
    let mut consider = |t: f64| {
        if t >= earliest && t < first {
            first = t.max(0.0);
        }
    };
    let normal = cross(sub(b, a), sub(c, a));
    let (size, speed) = (length(normal), dot(normal, direction));
    if size > 0.0 {
        let height = -dot(normal, a);
        // The plane on the side where the center starts.
        let t = ((radius * size).copysign(height) - height) / speed;
        let center = scale(direction, t);
        let weight = |from: Vector, to: Vector| dot(cross(sub(to, from), sub(center, from)), normal);
        if t.is_finite() && weight(a, b) >= 0.0 && weight(b, c) >= 0.0 && weight(c, a) >= 0.0 {
            consider(t);
        }
    }
    for [start, end] in [[a, b], [b, c], [c, a]] {
        let edge = sub(end, start);
        let squared = dot(edge, edge);
        if squared > 0.0 {
            // Perpendicular to the edge.
            let across = |v: Vector| sub(v, scale(edge, dot(v, edge) / squared));
            let t = entry(across(start), across(direction), radius);
            let along = dot(sub(scale(direction, t), start), edge);
            if (0.0..=squared).contains(&along) {
                consider(t);
            }
        }
        consider(entry(start, direction, radius));
    }
    let t = f64::from(ray.t_min) + first;
    t.is_finite().then_some(t)
}

/// When a point that starts at zero comes within `radius` of `center`; NaN if never.
fn entry(center: Vector, direction: Vector, radius: f64) -> f64 {
    let squared = dot(direction, direction);
    let nearest = dot(center, direction) / squared;
    let miss = sub(scale(direction, nearest), center);
    nearest - ((radius * radius - dot(miss, miss)) / squared).sqrt()
}
