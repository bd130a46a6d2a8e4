use super::finish::finish;
use super::{Axis, Kernel, TriangleHit};
use crate::ScaledRay;
use crate::rounding::nearest;
use crate::vector::{cross, dot, reach, sub, wide};

/// The kernel that reads a precomputed map per triangle: least arithmetic, most memory.
///
/// Reads: a ray, a record. Writes: the hit.
/// Holds: reported points lie within [`HIT_ERROR`](crate::HIT_ERROR); `t`, `u`, `v` have the bits of
/// [`MollerTrumbore`](crate::MollerTrumbore)'s where both hit. Its filter sees the triangle from the coordinate
/// origin, so triangles small against their distance from there lose hits near their edges first.
/// Source: Baldwin, Weber 2016, with a coordinate axis as the free vector; acceptance also asks `u + v <= 1` and the
/// interval of `t`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BaldwinWeber;

/// Least greatest component of the normal, relative to the edges, for which the map is used.
///
/// The map's entries carry a rounding each, and the normal divides them: below 2^-20 no weight would keep more than
/// four bits. Such slivers are left to the finish.
const SLIVER: f64 = 1.0 / (1 << 20) as f64;

/// A triangle and the affine map that takes it to the corners (0,0), (1,0), (0,1) of the plane `z = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaldwinWeberRecord {
    /// The triangle.
    vertices: [[f32; 3]; 3],
    /// Rows giving weights `u` and `v`, then the height `z`: factors of the two other coordinates, and a constant.
    /// The height has factor 1 on the free axis, the weights have 0.
    rows: [[f32; 3]; 3],
    /// The free axis, where the normal is greatest; `None` for slivers, which the map cannot hold.
    axis: Option<Axis>,
}

impl BaldwinWeberRecord {
    /// Whether the ray's line certainly misses, as far as f32 and the map can say.
    #[inline]
    fn filters_out(&self, ray: &ScaledRay) -> bool {
        let Some(axis) = self.axis else { return false };
        let [o_a, o_b, o_c] = axis.last(ray.origin);
        let [d_a, d_b, d_c] = axis.last(ray.direction);
        let [row_u, row_v, row_z] = self.rows;
        let height = (row_z[0] * o_a + row_z[1] * o_b) + (o_c + row_z[2]);
        let slope = (row_z[0] * d_a + row_z[1] * d_b) + d_c;
        let t = -height / slope;
        let (a, b) = (o_a + t * d_a, o_b + t * d_b);
        let u = (row_u[0] * a + row_u[1] * b) + row_u[2];
        let v = (row_v[0] * a + row_v[1] * b) + row_v[2];
        // A parallel ray makes infinities: whatever is not a number stays for the finish.
        u < 0.0 || v < 0.0 || u + v > 1.0
    }
}

impl Kernel for BaldwinWeber {
    type Record = BaldwinWeberRecord;
    type Prepared = ();

    fn record(vertices: [[f32; 3]; 3]) -> BaldwinWeberRecord {
        let [v0, v1, v2] = vertices.map(wide);
        let (e1, e2) = (sub(v1, v0), sub(v2, v0));
        let normal = cross(e1, e2);
        let axis = Axis::of_greatest(normal, f64::abs);
        let [n, [e1_a, e1_b, _], [e2_a, e2_b, _], v0] = [normal, e1, e2, v0].map(|p| axis.last(p));
        let row_u = [e2_b / n[2], -e2_a / n[2]];
        let row_v = [-e1_b / n[2], e1_a / n[2]];
        let with_constant = |[a, b]: [f64; 2], c: f64| [a, b, c].map(nearest);
        let rows = [
            with_constant(row_u, -(row_u[0] * v0[0] + row_u[1] * v0[1])),
            with_constant(row_v, -(row_v[0] * v0[0] + row_v[1] * v0[1])),
            with_constant([n[0] / n[2], n[1] / n[2]], -dot(n, v0) / n[2]),
        ];
        let regular = n[2].abs() > SLIVER * reach(e1) * reach(e2) && rows.iter().flatten().all(|x| x.is_finite());
        BaldwinWeberRecord { vertices, rows, axis: regular.then_some(axis) }
    }

    #[inline]
    fn prepare(_: &ScaledRay) {}

    #[inline]
    fn intersect((): &(), ray: &ScaledRay, record: &BaldwinWeberRecord, t_max: f32) -> Option<TriangleHit> {
        if record.filters_out(ray) {
            return None;
        }
        finish(ray, &record.vertices, t_max)
    }
}
