//! Nearest points of two convex shapes.
//!
//! Of two triangles, segments or points, the nearest points are a vertex and a face, or interior points of two edges, unless they touch, which is
//! decided exactly. Hulls of more points are searched by their supporting points (Gilbert, Johnson and Keerthi 1988); each step computes the nearest
//! point of at most four of them. Radii are subtracted from the distance of the hulls.

use std::cmp::Ordering;

use canted_obb::orient_3d_f64;
use canted_obb::vector::{Vector, add, cross, dot, length, reach, scale, sub};
use canted_trace::closest_to_zero;

use crate::touch::{share_a_point, triangles_touch};
use crate::walk::PlacedShape;

/// By how much the distance of hulls may exceed the sum of their radii if they are to touch, relative to the coordinates.
const TOUCHING: f64 = 1.0 / (1_u64 << 42) as f64;

/// Steps of a search, far more than it takes.
const MOST_STEPS: usize = 128;

/// The nearest points of two shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closest {
    pub(crate) distance: f64,
    pub(crate) points: [Vector; 2],
}

/// Whether shapes need no distance to decide whether they touch.
fn are_exact(a: &PlacedShape, b: &PlacedShape) -> bool {
    a.radius == 0.0 && b.radius == 0.0 && a.points.len().max(b.points.len()) <= 3
}

/// Whether two shapes share a point.
pub(crate) fn touch(a: &PlacedShape, b: &PlacedShape) -> bool {
    if a.points.is_empty() || b.points.is_empty() {
        return false;
    }
    if are_exact(a, b) { share_a_point(&a.points, &b.points) } else { closest_points(a, b).distance == 0.0 }
}

/// The nearest points of two shapes; infinitely far apart where one has no points.
pub(crate) fn closest_points(a: &PlacedShape, b: &PlacedShape) -> Closest {
    if a.points.is_empty() || b.points.is_empty() {
        return Closest { distance: f64::INFINITY, points: [[f64::NAN; 3]; 2] };
    }
    if are_exact(a, b) {
        return of_triangles(filled(&a.points), filled(&b.points));
    }
    let points = if a.points.len().max(b.points.len()) <= 3 {
        of_triangles(filled(&a.points), filled(&b.points)).points
    } else {
        of_hulls(&a.points, &b.points)
    };
    let between = sub(points[1], points[0]);
    let (between_length, radii) = (length(between), a.radius + b.radius);
    let greatest = a.points.iter().chain(&b.points).fold(radii, |most, &point| most.max(reach(point)));
    if between_length - radii <= TOUCHING * greatest {
        // A point on both.
        let part = if between_length > 0.0 { (a.radius / between_length).min(1.0) } else { 0.0 };
        return Closest { distance: 0.0, points: [add(points[0], scale(between, part)); 2] };
    }
    let unit = scale(between, 1.0 / between_length);
    let points = [add(points[0], scale(unit, a.radius)), sub(points[1], scale(unit, b.radius))];
    Closest { distance: between_length - radii, points }
}

/// Three vertices of at most three points.
fn filled(points: &[Vector]) -> [Vector; 3] {
    std::array::from_fn(|i| points[i.min(points.len() - 1)])
}

/// The nearest of some candidates.
struct Nearest {
    squared: f64,
    points: [Vector; 2],
}

impl Nearest {
    fn consider(&mut self, points: [Vector; 2]) {
        let between = sub(points[1], points[0]);
        let squared = dot(between, between);
        if squared < self.squared {
            *self = Self { squared, points };
        }
    }
}

/// The nearest points of two triangles, which may be degenerate.
fn of_triangles(a: [Vector; 3], b: [Vector; 3]) -> Closest {
    let mut nearest = Nearest { squared: f64::INFINITY, points: [a[0], b[0]] };
    for vertex in a {
        nearest.consider([vertex, on_triangle(vertex, b)]);
    }
    for vertex in b {
        nearest.consider([on_triangle(vertex, a), vertex]);
    }
    for one in edges(a) {
        for other in edges(b) {
            nearest.points_of_lines(one, other);
        }
    }
    if !triangles_touch(a, b) {
        // A gap that roundings close is one nevertheless.
        return Closest { distance: nearest.squared.sqrt().max(f64::MIN_POSITIVE), points: nearest.points };
    }
    for edge in edges(a) {
        nearest.piercing(edge, b);
    }
    for edge in edges(b) {
        nearest.piercing(edge, a);
    }
    Closest { distance: 0.0, points: [nearest.points[0]; 2] }
}

fn edges([a, b, c]: [Vector; 3]) -> [[Vector; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The point of a triangle that is closest to `point`.
fn on_triangle(point: Vector, triangle: [Vector; 3]) -> Vector {
    let [a, b, c] = triangle.map(|vertex| sub(vertex, point));
    let closest = closest_to_zero(&[a, b, c]);
    std::array::from_fn(|k| point[k] + (a[k] + (closest.u * (b[k] - a[k]) + closest.v * (c[k] - a[k]))))
}

impl Nearest {
    /// Interior points of two edges, where their lines are nearest.
    fn points_of_lines(&mut self, [p, p_end]: [Vector; 2], [q, q_end]: [Vector; 2]) {
        let (d, e, between) = (sub(p_end, p), sub(q_end, q), sub(p, q));
        let (dd, de, ee) = (dot(d, d), dot(d, e), dot(e, e));
        let determinant = dd * ee - de * de;
        let s = (de * dot(e, between) - ee * dot(d, between)) / determinant;
        let t = (de * s + dot(e, between)) / ee;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            self.consider([add(p, scale(d, s)), add(q, scale(e, t))]);
        }
    }

    /// The point where an edge meets the plane of a triangle, and the point of the triangle nearest to it.
    fn piercing(&mut self, [p, q]: [Vector; 2], triangle: [Vector; 3]) {
        let [a, b, c] = triangle;
        let normal = cross(sub(b, a), sub(c, a));
        let [from, to] = [p, q].map(|point| dot(normal, sub(point, a)));
        let s = from / (from - to);
        if (0.0..=1.0).contains(&s) {
            let point = add(p, scale(sub(q, p), s));
            self.consider([point, on_triangle(point, triangle)]);
        }
    }
}

/// A point of the difference of two hulls, and the points whose difference it is.
#[derive(Clone, Copy)]
struct Support {
    difference: Vector,
    points: [Vector; 2],
}

/// The nearest points of two hulls; equal, up to rounding, where they overlap.
fn of_hulls(a: &[Vector], b: &[Vector]) -> [Vector; 2] {
    let farthest = |points: &[Vector], direction: Vector| {
        let along = |&point: &Vector| dot(point, direction);
        points.iter().copied().max_by(|x, y| along(x).total_cmp(&along(y))).unwrap_or(points[0])
    };
    let support = |direction: Vector| {
        let points = [farthest(a, direction), farthest(b, scale(direction, -1.0))];
        Support { difference: sub(points[0], points[1]), points }
    };
    let mut simplex = vec![support([1.0, 0.0, 0.0])];
    let mut best = (dot(simplex[0].difference, simplex[0].difference), simplex[0].points);
    for _ in 0..MOST_STEPS {
        let to_nearest = sub(best.1[0], best.1[1]);
        let next = support(scale(to_nearest, -1.0));
        simplex.push(next);
        let (points, kept) = nearest_of_simplex(&simplex);
        let between = sub(points[0], points[1]);
        let squared = dot(between, between);
        // Nothing is nearer, up to rounding: the search ends, as it does in the hulls' overlap.
        if squared.is_nan() || squared >= best.0 {
            break;
        }
        best = (squared, points);
        simplex = kept;
    }
    best.1
}

/// The points of two hulls whose difference is the point of a simplex nearest to zero, and the vertices that they depend on.
fn nearest_of_simplex(simplex: &[Support]) -> ([Vector; 2], Vec<Support>) {
    let of_face = |face: [Support; 3]| {
        let closest = closest_to_zero(&face.map(|vertex| vertex.difference));
        let weights = [1.0 - closest.u - closest.v, closest.u, closest.v];
        (closest.distance_squared, weighted(&face, &weights))
    };
    match *simplex {
        [a, b, c, d] => {
            if is_zero_inside([a, b, c, d].map(|vertex| vertex.difference)) {
                let point = inside_points([a, b, c, d]);
                return (point, simplex.to_vec());
            }
            let faces = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]].map(of_face);
            let nearest = faces.into_iter().min_by(|one, other| one.0.total_cmp(&other.0));
            nearest.map_or_else(|| (a.points, vec![a]), |nearest| nearest.1)
        }
        [a, b, c] => of_face([a, b, c]).1,
        [a, b] => of_face([a, b, b]).1,
        _ => (simplex[0].points, simplex.to_vec()),
    }
}

/// Points at these weights of three vertices, and the vertices with a weight.
fn weighted(face: &[Support; 3], weights: &[f64; 3]) -> ([Vector; 2], Vec<Support>) {
    let points = [0, 1].map(|side| {
        let [a, b, c] = face.map(|vertex| vertex.points[side]);
        std::array::from_fn(|k| a[k] + (weights[1] * (b[k] - a[k]) + weights[2] * (c[k] - a[k])))
    });
    let kept = face.iter().zip(weights).filter(|(_, weight)| **weight > 0.0).map(|(vertex, _)| *vertex);
    (points, kept.collect())
}

/// Whether zero is in a tetrahedron, or on its surface; not in a flat one.
fn is_zero_inside([a, b, c, d]: [Vector; 4]) -> bool {
    let zero = [0.0; 3];
    let whole = orient_3d_f64(a, b, c, d);
    let parts = [(zero, b, c, d), (a, zero, c, d), (a, b, zero, d), (a, b, c, zero)]
        .map(|(a, b, c, d)| orient_3d_f64(a, b, c, d));
    whole != Ordering::Equal && parts.iter().all(|&part| part == whole || part == Ordering::Equal)
}

/// One point of both hulls, for a tetrahedron around zero: at the weights of zero.
fn inside_points(simplex: [Support; 4]) -> [Vector; 2] {
    let [a, b, c, d] = simplex.map(|vertex| vertex.difference);
    let volume = |a: Vector, b: Vector, c: Vector| dot(a, cross(b, c)).abs();
    let weights = [volume(b, c, d), volume(a, c, d), volume(a, b, d), volume(a, b, c)];
    let sum: f64 = weights.iter().sum();
    let point = if sum > 0.0 {
        std::array::from_fn(|k| (0..4).map(|i| weights[i] / sum * simplex[i].points[0][k]).sum())
    } else {
        simplex[0].points[0]
    };
    [point; 2]
}
