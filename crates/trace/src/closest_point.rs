use canted_obb::vector::{cross, dot, sub, to_f64};

use crate::rounding::UNIT_ROUNDOFF_F64;

/// The point of a triangle that is closest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrianglePoint {
    /// Squared distance.
    pub distance_squared: f64,
    /// Weight of the second vertex.
    pub u: f64,
    /// Weight of the third vertex.
    pub v: f64,
}

/// By how much a computed distance may fall short of the true one, relative to the distance of the farthest vertex: four
/// roundings of `f64` touch a coordinate of the offset, whose terms are at most three such distances; doubled.
pub const DISTANCE_ERROR: f64 = 24.0 * UNIT_ROUNDOFF_F64;

/// The point of a triangle that is closest to `point`, computed in `f64`.
///
/// The weights `1 - u - v`, `u`, `v` are not negative, so the result is a point of the triangle up to [`DISTANCE_ERROR`].
/// Its distance exceeds the least by as little, unless the triangle is thinner than 2^-24 of its length; then by at most
/// 2^-26 of its longest edge.
///
/// The candidates are the closest points of the three edges and, if the projection falls inside, the projection onto
/// the plane. A thin triangle loses digits of its normal, but its edges are then almost as close.
/// Source: Ericson 2005, section 5.1.5, with the regions replaced by candidates.
///
/// ```
/// use canted_trace::closest_point_on_triangle;
///
/// let triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
/// let closest = closest_point_on_triangle([1.0, 2.0, 3.0], &triangle);
/// assert_eq!((closest.distance_squared, closest.u, closest.v), (9.0, 0.25, 0.5));
/// ```
#[must_use]
pub fn closest_point_on_triangle(point: [f32; 3], vertices: &[[f32; 3]; 3]) -> TrianglePoint {
    let point = to_f64(point);
    // All vectors start at the query point, which keeps differences small.
    closest_to_zero(&vertices.map(|vertex| sub(to_f64(vertex), point)))
}

/// As [`closest_point_on_triangle`], for a query point at zero.
#[must_use]
pub fn closest_to_zero(&[a, b, c]: &[[f64; 3]; 3]) -> TrianglePoint {
    let (ab, ac, bc) = (sub(b, a), sub(c, a), sub(c, b));
    let along = [on_edge(a, ab), on_edge(a, ac), on_edge(b, bc)];
    let edges = [[along[0], 0.0], [0.0, along[1]], [1.0 - along[2], along[2]]];
    let mut best = TrianglePoint { distance_squared: f64::INFINITY, u: 0.0, v: 0.0 };
    let mut consider = |[u, v]: [f64; 2]| {
        let offset: [f64; 3] = core::array::from_fn(|k| a[k] + (u * ab[k] + v * ac[k]));
        let distance_squared = dot(offset, offset);
        if distance_squared < best.distance_squared {
            best = TrianglePoint { distance_squared, u, v };
        }
    };
    edges.into_iter().for_each(&mut consider);
    let normal = cross(ab, ac);
    let area_squared = dot(normal, normal);
    let u = dot(cross(ac, a), normal) / area_squared;
    let v = dot(cross(a, ab), normal) / area_squared;
    // False where the area is zero.
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
        consider([u, v]);
    }
    best
}

/// Where on the edge from `start` along `edge` the origin is closest, 0 to 1.
fn on_edge(start: [f64; 3], edge: [f64; 3]) -> f64 {
    let length_squared = dot(edge, edge);
    if length_squared > 0.0 { (-dot(start, edge) / length_squared).clamp(0.0, 1.0) } else { 0.0 }
}
