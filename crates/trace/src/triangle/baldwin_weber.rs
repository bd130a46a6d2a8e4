use super::moller_trumbore::{Weights, finish, norm};
use super::{Axis, Kernel, TriangleHit};
use crate::ScaledRay;
use crate::rounding::{UNIT_ROUNDOFF, nearest};
use canted_obb::flat_as_edge;
use canted_obb::vector::{cross, reach, sub, to_f64};

/// Error of the barycentric coordinates, relative to `F·S`, see below.
const ERROR: f32 = 64.0 * UNIT_ROUNDOFF;

/// Error of the determinant, and the tolerance of `finish`, see below.
const DET_ERROR: f32 = 44.0 * UNIT_ROUNDOFF;

/// No intermediate value of the filter exceeds `HEADROOM·S` before the last step, or `HEADROOM·F·S` in it: if these are
/// finite, nothing overflows.
const HEADROOM: f32 = 8.0;

/// Least greatest component of the normal, relative to the edges, for which the map is used.
///
/// The f64 roundings of the normal, at most 8 of 2^-53 in two terms, are then within 2^-29 of it: 1/32 of an f32
/// rounding. Thinner triangles are left to `finish`.
const SLIVER: f64 = 1.0 / (1 << 20) as f64;

/// Least sum of the entries of the map for which underflow is negligible in each.
const LEAST_FACTOR: f32 = f32::MIN_POSITIVE / UNIT_ROUNDOFF;

/// The kernel with a precomputed map per triangle: least arithmetic, most memory.
///
/// Reads: a ray, a record. Writes: the hit.
/// Holds: reported points lie within [`HIT_ERROR`](crate::HIT_ERROR); hits have the bits of
/// [`MollerTrumbore`](crate::MollerTrumbore)'s. The filter rejects nothing that `finish` accepts, wherever the triangle
/// lies.
/// Source: Baldwin, Weber 2016, with a coordinate axis as the free vector. Differences: the map is relative to a
/// vertex, not the coordinate origin, because `o - v0` has one relative rounding only; the slope along the ray is a
/// factor instead of a divisor, so the error bound, which is ours, needs no special case for grazing rays.
///
/// # Error of the filter
/// Let u = 2^-24, `s = o - v0`, `S` the sum of its absolute components, `F` that of the entries of both weight rows.
/// The direction's components are below 2; entries of the height row are at most 1, since the free axis is the normal's
/// greatest.
/// - The height `h = z_a·s_a + z_b·s_b + s_c` has at most 5 roundings in a term (entry, `s`, product, two sums):
///   5 u·S, and `|h| <= S`. The slope `m` has 4, 4 and 1 in terms of at most 2: 18 u, and `|m| <= 6`.
/// - `A = s_a·m - h·d_a` takes over 18 u·S from `m` and 10 u·S from `h`. The roundings of `s_a` and of the products add
///   6, 6 and 2 u·S. Two terms cancel exactly, so `|A| <= 4S`, and the difference adds 4 u·S: in all 46 u·S.
/// - `u·m = U_a·A + U_b·B` has three roundings more (entry, product, sum) of 4S: 58 u·S for each unit of
///   `|U_a| + |U_b|`. Likewise `v·m`. Their sum is off by 58 u·F·S, and rounding it adds 4 u·F·S: 62 u·F·S.
///   Second-order terms, the f64 roundings of the rows and those of `finish` stay below the remaining 2.
/// - `m`, with which the sum is compared, adds its 18 u, and `finish` its 4 u·|m| <= 24 u; second-order terms and the
///   f64 determinant of `finish` stay below the remaining 2.
/// - Products that underflow are off by 2^-150 each: six, counted with their factors, in `A`. `MIN_POSITIVE`, added to
///   `S`, exceeds 64 of them. Later ones are negligible against the 44 u.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BaldwinWeber;

/// A triangle and the linear map of its edges to (1,0,0) and (0,1,0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaldwinWeberRecord {
    /// The triangle.
    vertices: [[f32; 3]; 3],
    /// Rows giving weights `u` and `v`, then the height `z`: factors of the two coordinates besides the free axis.
    /// The height has factor 1 on the free axis, the weights have 0.
    rows: [[f32; 2]; 3],
    /// Sum of the absolute factors of the weights; infinite where the map cannot hold the triangle.
    factor: f32,
    /// The free axis, where the normal is greatest.
    axis: Axis,
}

/// The weights of the ray's line; `det` is the normal times the direction, over the normal's greatest component.
#[inline]
pub fn weights(ray: &ScaledRay, record: &BaldwinWeberRecord) -> Weights {
    let s = sub(ray.origin, record.vertices[0]);
    let [s_a, s_b, s_c] = record.axis.permute(s);
    let [d_a, d_b, d_c] = record.axis.permute(ray.direction);
    let [row_u, row_v, row_z] = record.rows;
    let height = (row_z[0] * s_a + row_z[1] * s_b) + s_c;
    let slope = (row_z[0] * d_a + row_z[1] * d_b) + d_c;
    let (a, b) = (s_a * slope - height * d_a, s_b * slope - height * d_b);
    let largest = record.factor * (HEADROOM * (norm(s) + f32::MIN_POSITIVE));
    Weights {
        det: slope,
        u: row_u[0] * a + row_u[1] * b,
        v: row_v[0] * a + row_v[1] * b,
        error: ERROR / HEADROOM * largest + DET_ERROR,
    }
}

impl Kernel for BaldwinWeber {
    type Record = BaldwinWeberRecord;
    type Prepared = ();

    fn record(vertices: [[f32; 3]; 3]) -> BaldwinWeberRecord {
        let vertices = flat_as_edge(vertices);
        let [v0, v1, v2] = vertices.map(to_f64);
        let (e1, e2) = (sub(v1, v0), sub(v2, v0));
        let normal = cross(e1, e2);
        let axis = Axis::from_greatest(normal, f64::abs);
        let [n, [e1_a, e1_b, _], [e2_a, e2_b, _]] = [normal, e1, e2].map(|p| axis.permute(p));
        let rows = [[e2_b, -e2_a], [-e1_b, e1_a], [n[0], n[1]]].map(|row| row.map(|x| nearest(x / n[2])));
        let factor: f32 = rows[..2].iter().flatten().map(|x| x.abs()).sum();
        let regular = n[2].abs() > SLIVER * reach(e1) * reach(e2) && factor > LEAST_FACTOR;
        BaldwinWeberRecord { vertices, rows, factor: if regular { factor } else { f32::INFINITY }, axis }
    }

    #[inline]
    fn prepare(_: &ScaledRay) {}

    #[inline]
    fn intersect((): &(), ray: &ScaledRay, record: &BaldwinWeberRecord, t_max: f32) -> Option<TriangleHit> {
        if weights(ray, record).misses() {
            return None;
        }
        finish(ray, &record.vertices, t_max)
    }
}
