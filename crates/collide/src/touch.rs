//! Whether two triangles, segments or points share a point, exactly.
//!
//! Two triangles that are not in one plane meet where the line common to their planes crosses both: six signs of volumes, and two more, decide
//! (Guigue and Devillers 2003). Every sign is exact, so touching at a vertex or along an edge counts. What is in one plane is
//! projected along an axis, which keeps incidences, and decided by signs of areas. A degenerate triangle is the segment or
//! the point that its vertices span.

use std::cmp::Ordering::{self, Equal, Greater, Less};

use canted_obb::vector::Vector;
use canted_obb::{orient_2d_f64, orient_3d_f64};

/// Whether the convex hulls of up to three points each share a point.
pub(crate) fn share_a_point(a: &[Vector], b: &[Vector]) -> bool {
    match (a, b) {
        (&[a0, a1, a2], &[b0, b1, b2]) => triangles_touch([a0, a1, a2], [b0, b1, b2]),
        // Segments and points are triangles with equal vertices.
        _ => triangles_touch(filled(a), filled(b)),
    }
}

/// Three vertices, the last one repeated.
fn filled(points: &[Vector]) -> [Vector; 3] {
    std::array::from_fn(|i| points[i.min(points.len() - 1)])
}

/// Whether two closed triangles share a point.
pub(crate) fn triangles_touch(a: [Vector; 3], b: [Vector; 3]) -> bool {
    let of_a = sides(a, b);
    if is_one_sided(of_a) {
        return false;
    }
    let of_b = sides(b, a);
    if is_one_sided(of_b) {
        return false;
    }
    if is_flat(of_a) || is_flat(of_b) {
        return flat_touch(a, b);
    }
    let (a, is_b_flipped) = lone_vertex_first(a, of_a);
    let (b, is_a_flipped) = lone_vertex_first(b, of_b);
    let ([p1, q1, r1], [p2, q2, r2]) = (turned(a, is_a_flipped), turned(b, is_b_flipped));
    orient_3d_f64(q2, p2, p1, q1) != Greater && orient_3d_f64(r2, p2, r1, p1) != Greater
}

/// On which side of the plane of `plane` each vertex is.
fn sides(vertices: [Vector; 3], [p, q, r]: [Vector; 3]) -> [Ordering; 3] {
    vertices.map(|vertex| orient_3d_f64(p, q, vertex, r))
}

/// Whether all vertices are strictly on one side.
fn is_one_sided([a, b, c]: [Ordering; 3]) -> bool {
    a != Equal && a == b && b == c
}

/// Whether all vertices are in the plane, or there is no plane.
fn is_flat(sides: [Ordering; 3]) -> bool {
    sides == [Equal; 3]
}

/// The triangle, rotated so that its first vertex is on one side of the other's plane, the rest on the opposite side or in it; and whether the
/// other triangle must be flipped for that side to be the positive one.
fn lone_vertex_first([p, q, r]: [Vector; 3], sides: [Ordering; 3]) -> ([Vector; 3], bool) {
    let only = |side: Ordering| {
        let mut with = (0..3).filter(|&i| sides[i] == side);
        with.next().filter(|_| with.next().is_none())
    };
    let (lone, is_flipped) = match (only(Greater), only(Less), only(Equal)) {
        (Some(i), _, _) => (i, false),
        (None, Some(i), _) => (i, true),
        // Two on one side, one in the plane.
        (None, None, Some(i)) => (i, sides[(i + 1) % 3] == Greater),
        (None, None, None) => unreachable!("three equal sides are decided before"),
    };
    ([[p, q, r], [q, r, p], [r, p, q]][lone], is_flipped)
}

fn turned([p, q, r]: [Vector; 3], is_flipped: bool) -> [Vector; 3] {
    if is_flipped { [p, r, q] } else { [p, q, r] }
}

/// Triangles in one plane, or one of them without a plane.
fn flat_touch(a: [Vector; 3], b: [Vector; 3]) -> bool {
    match (has_no_area(a), has_no_area(b)) {
        (false, false) => touch_in_plane(&a, &b),
        (false, true) => edges(&b).any(|edge| segment_touches_triangle(edge, a)),
        (true, false) => edges(&a).any(|edge| segment_touches_triangle(edge, b)),
        (true, true) => edges(&a).any(|one| {
            edges(&b)
                .any(|other| orient_3d_f64(one[0], one[1], other[0], other[1]) == Equal && touch_in_plane(&one, &other))
        }),
    }
}

/// The two coordinates that projections along each axis keep.
const PLANES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// A sign of an area in a projection.
fn area([x, y]: [usize; 2], a: Vector, b: Vector, c: Vector) -> Ordering {
    orient_2d_f64([a[x], a[y]], [b[x], b[y]], [c[x], c[y]])
}

fn has_no_area([a, b, c]: [Vector; 3]) -> bool {
    PLANES.iter().all(|&plane| area(plane, a, b, c) == Equal)
}

/// All pairs of consecutive vertices; of a segment both directions.
fn edges(vertices: &[Vector]) -> impl Iterator<Item = [Vector; 2]> {
    (0..vertices.len()).map(|i| [vertices[i], vertices[(i + 1) % vertices.len()]])
}

/// Whether a closed segment and a triangle with an area share a point.
fn segment_touches_triangle([start, end]: [Vector; 2], triangle: [Vector; 3]) -> bool {
    let [p, q, r] = triangle;
    match [start, end].map(|point| orient_3d_f64(p, q, point, r)) {
        [Equal, Equal] => touch_in_plane(&[start, end], &triangle),
        [a, b] if a == b => false,
        _ => {
            let around = [[p, q], [q, r], [r, p]].map(|[a, b]| orient_3d_f64(start, end, a, b));
            !(around.contains(&Greater) && around.contains(&Less))
        }
    }
}

/// Whether the hulls of two sets of points in one plane share a point.
fn touch_in_plane(a: &[Vector], b: &[Vector]) -> bool {
    let all = || a.iter().chain(b).copied();
    let is_usable = |&plane: &[usize; 2]| {
        let first = a[0];
        all().any(|second| all().any(|third| area(plane, first, second, third) != Equal))
    };
    // Not along a direction in the plane: that would map it to a line.
    let Some(&plane) = PLANES.iter().find(|plane| is_usable(plane)) else {
        // All points are on a line.
        return (0..3).all(|k| ranges_meet(a, b, k));
    };
    let contains = |points: &[Vector], p: Vector| {
        let &[a, b, c] = points else { return false };
        let around = [[a, b], [b, c], [c, a]].map(|[start, end]| area(plane, start, end, p));
        area(plane, a, b, c) != Equal && !(around.contains(&Greater) && around.contains(&Less))
    };
    edges(a).any(|one| edges(b).any(|other| segments_touch(plane, one, other)))
        || contains(a, b[0])
        || contains(b, a[0])
}

/// Whether the intervals of two sets of points along an axis meet.
fn ranges_meet(a: &[Vector], b: &[Vector], k: usize) -> bool {
    let range = |points: &[Vector]| {
        points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], p| [lo.min(p[k]), hi.max(p[k])])
    };
    let ([a_lo, a_hi], [b_lo, b_hi]) = (range(a), range(b));
    a_lo <= b_hi && b_lo <= a_hi
}

/// Whether two closed segments of a projection share a point: their boxes do, and each has its ends on both sides of the other's line, or on it.
fn segments_touch(plane: [usize; 2], [a, b]: [Vector; 2], [c, d]: [Vector; 2]) -> bool {
    let straddles = |[p, q]: [Vector; 2], [r, s]: [Vector; 2]| {
        let sides = [area(plane, p, q, r), area(plane, p, q, s)];
        sides[0] != sides[1] || sides[0] == Equal
    };
    plane.iter().all(|&k| ranges_meet(&[a, b], &[c, d], k)) && straddles([a, b], [c, d]) && straddles([c, d], [a, b])
}
