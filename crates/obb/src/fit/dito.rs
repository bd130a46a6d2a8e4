use crate::frame::{Frame, IDENTITY, orthonormal};
use crate::vector::{self, Vector, cross, dot, sub};

/// The coordinate axes and the body diagonals: seven directions, fourteen extremal points.
const DIRECTIONS: [Vector; 7] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
];

/// A point closer to a line or plane than this fraction of the base edge counts as on it: rounding a flat set to `f32`
/// moves points by up to two units in the last place on each of three coordinates.
const FLAT: f64 = 6.0 * f32::EPSILON as f64;

/// A frame along an edge and a normal of a large ditetrahedron (Larsson and Källberg 2011, DiTO-14).
///
/// The base edge is the longest span between opposite extremal points. The extremal point farthest from it completes the
/// base triangle, and the points farthest from that on both sides complete two tetrahedra. Each edge of their seven
/// triangles, with the triangle's normal, is a candidate frame; the least area of the box of the extremal points wins. A
/// point set without extent in some dimension skips the steps that need it, as in the paper. Unlike in the paper, the
/// apexes count as extremal points.
pub(super) fn frame(points: &[[f32; 3]]) -> Frame {
    // Relative to the first point, for precision far from the origin.
    let origin = vector::to_f64(points[0]);
    let points = || points.iter().map(|&p| sub(vector::to_f64(p), origin));
    let spans = DIRECTIONS.map(|direction| extremes(points(), direction));
    let [p, q] = spans.into_iter().fold(spans[0], |longest, span| {
        if square(sub(span[1], span[0])) > square(sub(longest[1], longest[0])) { span } else { longest }
    });
    let base = sub(q, p);
    let length = vector::length(base);
    if length == 0.0 {
        return IDENTITY;
    }
    let from_line = |r: Vector| vector::length(cross(base, sub(r, p))) / length;
    let corners = spans.as_flattened();
    let r = corners.iter().fold(p, |far, &corner| if from_line(corner) > from_line(far) { corner } else { far });
    if from_line(r) <= FLAT * length {
        return orthonormal(base, [0.0; 3]);
    }
    let normal = cross(base, sub(r, p));
    let apexes = extremes(points(), normal);
    let measured = core::array::from_fn(|i| if i < corners.len() { corners[i] } else { apexes[i - corners.len()] });
    let mut search = Search { measured, best: (f64::INFINITY, IDENTITY) };
    search.add_triangle(p, q, r);
    for apex in apexes {
        if dot(sub(apex, p), normal).abs() > FLAT * length * vector::length(normal) {
            search.add_triangle(p, q, apex);
            search.add_triangle(q, r, apex);
            search.add_triangle(r, p, apex);
        }
    }
    search.best.1
}

/// The candidate of least area so far.
struct Search {
    measured: [Vector; 2 * DIRECTIONS.len() + 2],
    best: (f64, Frame),
}

impl Search {
    /// Tries the frames of each edge with the normal.
    fn add_triangle(&mut self, a: Vector, b: Vector, c: Vector) {
        let normal = cross(sub(b, a), sub(c, a));
        for edge in [sub(b, a), sub(c, b), sub(a, c)] {
            let frame = orthonormal(edge, normal);
            let [x, y, z] = frame.map(|axis| {
                let axis = vector::to_f64(axis);
                let [low, high] = extremes(self.measured.into_iter(), axis);
                dot(sub(high, low), axis)
            });
            let area = x * y + y * z + z * x;
            if area < self.best.0 {
                self.best = (area, frame);
            }
        }
    }
}

/// The points lowest and highest along a direction, the first of equals.
fn extremes(points: impl Iterator<Item = Vector>, direction: Vector) -> [Vector; 2] {
    let mut low = (f64::INFINITY, [0.0; 3]);
    let mut high = (f64::NEG_INFINITY, [0.0; 3]);
    for point in points {
        let height = dot(point, direction);
        if height < low.0 {
            low = (height, point);
        }
        if height > high.0 {
            high = (height, point);
        }
    }
    [low.1, high.1]
}

fn square(v: Vector) -> f64 {
    dot(v, v)
}
