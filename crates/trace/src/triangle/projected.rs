use super::moller_trumbore::{Weights, finish, norm};
use super::{Axis, Kernel, TriangleHit};
use crate::ScaledRay;
use crate::rounding::{UNIT_ROUNDOFF, nearest};
use canted_obb::flat_as_edge;
use canted_obb::vector::{cross, reach, sub, to_f64};

/// Error of the barycentric coordinates, relative to `E·(S + E)`, see below.
const ERROR: f32 = 64.0 * UNIT_ROUNDOFF;

/// No intermediate value of the filter exceeds `HEADROOM·E·(S + E)`: if that is finite, nothing overflows.
const HEADROOM: f32 = 8.0;

/// Least greatest component of the normal, relative to the edges, for which the plane is used, as in
/// [`BaldwinWeber`](crate::BaldwinWeber); thinner triangles are left to `finish`.
const SLIVER: f64 = 1.0 / (1 << 20) as f64;

/// The kernel that projects the triangle along the axis where its normal is greatest, and tests two edges in that plane. For comparison,
/// and as a [`Kernel`] alone: BVHs do not store its records.
///
/// It is not watertight: each triangle divides its own plane, so that a ray exactly through a shared edge may miss both triangles.
///
/// Reads: a ray, a record. Writes: the hit.
/// Holds: reported points lie within [`HIT_ERROR`](crate::HIT_ERROR); hits have the bits of
/// [`MollerTrumbore`](crate::MollerTrumbore)'s. The filter rejects nothing that `finish` accepts, wherever the triangle lies.
/// Source: the projected tests of Badouel 1990 and Wald 2004, which Silva compares. Differences: the plane is relative to a vertex; the point
/// of the ray in the plane stays multiplied with the slope instead of divided by it, so rays along the plane need no special case; edges are
/// subtracted in the test instead of stored with their quotients. The error bound is ours.
///
/// # Error of the filter
/// Let u = 2^-24, `s = o - v0` with its sum `S` of absolute components, and `E` the sum of the absolute components of both edges in the
/// projection. The height `h`, the slope `m` and the point `(A, B)` of the ray times `m` are computed as in
/// [`BaldwinWeber`](crate::BaldwinWeber), whose bounds hold: `m` is off by 18 u and `|m| <= 6`; `A` is off by 46 u·S and `|A| <= 4S`.
/// - A weight is a sum of `A` and `B` times components of one edge, with three roundings more (edge, product, sum) of 4S: 58 u·S for each unit
///   of these components. Both weights together are off by 58 u·E·S, and rounding their sum adds 4 u·E·S: 62 u·E·S.
/// - The doubled area of the projection is `e1_a·e2_b - e1_b·e2_a`, of which the terms sum to at most `Q <= E·E/4`. Its roundings (two edges,
///   product, difference) are 4 u·Q. Times `m`: 24 u·Q from the area, 18 u·Q from `m`, 6 u·Q for the product, and 24 u·Q for the tolerance
///   of `finish`. In all 72 u·Q, at most 18 u·E·E.
/// - Second-order terms and the f64 roundings of the plane and of `finish` stay below the remaining 2 u·E·S and 46 u·E·E.
/// - Products that underflow are off by 2^-150 each. Those of `A` and `B` are covered by the `MIN_POSITIVE` in `E` as in
///   [`BaldwinWeber`](crate::BaldwinWeber), the others by the `MIN_POSITIVE` added to the total.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Projected;

/// A triangle and its plane over the projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedRecord {
    /// The triangle.
    vertices: [[f32; 3]; 3],
    /// The normal's other components over its greatest.
    slopes: [f32; 2],
    /// Sum of the absolute components of both edges in the projection; infinite where the slopes cannot hold the plane.
    edges: f32,
    /// The axis of the projection.
    axis: Axis,
}

/// The weights of the ray's line; `det` is the normal times the direction.
#[inline]
pub fn weights(ray: &ScaledRay, record: &ProjectedRecord) -> Weights {
    let [v0, v1, v2] = record.vertices;
    let s = sub(ray.origin, v0);
    let [s_a, s_b, s_c] = record.axis.permute(s);
    let [d_a, d_b, d_c] = record.axis.permute(ray.direction);
    let [n_a, n_b] = record.slopes;
    let height = (n_a * s_a + n_b * s_b) + s_c;
    let slope = (n_a * d_a + n_b * d_b) + d_c;
    let (a, b) = (s_a * slope - height * d_a, s_b * slope - height * d_b);
    let [[e1_a, e1_b, _], [e2_a, e2_b, _]] = [v1, v2].map(|v| record.axis.permute(sub(v, v0)));
    let largest = record.edges * (HEADROOM * (norm(s) + record.edges));
    Weights {
        det: slope * (e1_a * e2_b - e1_b * e2_a),
        u: a * e2_b - b * e2_a,
        v: b * e1_a - a * e1_b,
        error: ERROR / HEADROOM * largest + f32::MIN_POSITIVE,
    }
}

impl Kernel for Projected {
    type Record = ProjectedRecord;
    type Prepared = ();

    fn record(vertices: [[f32; 3]; 3]) -> ProjectedRecord {
        let vertices = flat_as_edge(vertices);
        let [v0, v1, v2] = vertices.map(to_f64);
        let (e1, e2) = (sub(v1, v0), sub(v2, v0));
        let normal = cross(e1, e2);
        let axis = Axis::from_greatest(normal, f64::abs);
        let [n_a, n_b, n_c] = axis.permute(normal);
        if n_c.abs() <= SLIVER * reach(e1) * reach(e2) {
            return ProjectedRecord { vertices, slopes: [0.0; 2], edges: f32::INFINITY, axis };
        }
        let components = [e1, e2].map(|edge| axis.permute(edge).map(f64::abs));
        let edges = nearest(components.iter().map(|[a, b, _]| a + b).sum::<f64>()) + f32::MIN_POSITIVE;
        ProjectedRecord { vertices, slopes: [n_a, n_b].map(|n| nearest(n / n_c)), edges, axis }
    }

    #[inline]
    fn prepare(_: &ScaledRay) {}

    #[inline]
    fn intersect((): &(), ray: &ScaledRay, record: &ProjectedRecord, t_max: f32) -> Option<TriangleHit> {
        if weights(ray, record).misses() {
            return None;
        }
        finish(ray, &record.vertices, t_max)
    }
}
