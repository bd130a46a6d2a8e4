use super::{Kernel, TriangleHit};
use crate::rounding::{UNIT_ROUNDOFF, nearest};
use crate::{ScaledRay, Side};
use canted_obb::flat_as_edge;
use canted_obb::vector::{cross, dot, reach, sub, to_f64};

/// Error of the barycentric coordinates, relative to `E·(S + E)`, see below.
pub const ERROR: f32 = 17.0 * UNIT_ROUNDOFF;

/// No intermediate value of the filter exceeds `HEADROOM·E·(S + E)`: if that is finite, nothing overflows.
pub const HEADROOM: f32 = 4.0;

/// The kernel without precomputation, for comparison: [`Watertight`](crate::Watertight) is faster here and closes shared edges. Rays
/// exactly through a shared edge may miss both triangles.
///
/// Reads: a ray, three vertices. Writes: the hit.
/// Holds: reported points lie within [`HIT_ERROR`](crate::HIT_ERROR); hits have the bits of
/// [`BaldwinWeber`](crate::BaldwinWeber)'s. Rays within about 1e-8 of the plane of the face miss. The filter rejects
/// nothing that `finish` accepts, at any scale.
/// Source: Möller, Trumbore 1997, without culling; the distance is computed in f64 only, so that the shrinking `t_max` of a
/// traversal cannot change which triangles are hit. The error bound of the filter is ours.
///
/// # Error of the filter
/// Let u = 2^-24 and `s = o - v0`; `|x|` is the sum of the absolute components, `E = |e1| + |e2|`, `S = |s|`. The
/// direction's components are below 2.
/// - Edges and `s` are off by u, relative. A component of `p = d x e2` has three roundings (edge, product, difference)
///   of terms that sum to at most `2|e2|`: 6 u·|e2|.
/// - `p·s` takes over 6 u·|e2|·S, and has four roundings (`s`, product, two sums) of `2|e2|·S`: 14 u·|e2|·S. Likewise
///   `det = p·e1` is off by 14 u·|e1|·|e2|. In `(s x e1)·d` seven roundings touch each of the six terms, which sum to
///   at most `2|e1|·S`: 14 u·|e1|·S.
/// - So `u + v` is off by 14 u·E·S, and rounding the sum adds 2 u·E·S. As `|e1|·|e2| <= E·E/4`, the error of `det` and
///   the 4 u·|det| of `finish` add 3.5 u·E·E and 2 u·E·E: all is within `16 u·E·(S + E)`. The rest of `ERROR` is for
///   second-order terms and for the f64 roundings of `finish`.
/// - A product that underflows is off by 2^-150 at most: in all less than `2^-150·(2S + 2E + 21)`. `MIN_POSITIVE`,
///   added to `E` and to the total, exceeds that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MollerTrumbore;

/// The barycentric coordinates of the line; `det` is minus the normal times the direction.
#[inline]
pub fn weights(ray: &ScaledRay, [v0, v1, v2]: &[[f32; 3]; 3]) -> Weights {
    let (e1, e2, s) = (sub(*v1, *v0), sub(*v2, *v0), sub(ray.origin, *v0));
    let p = cross(ray.direction, e2);
    let edges = norm(e1) + norm(e2) + f32::MIN_POSITIVE;
    let largest = HEADROOM * (edges * (norm(s) + edges));
    Weights {
        det: dot(p, e1),
        u: dot(p, s),
        v: dot(cross(s, e1), ray.direction),
        error: ERROR / HEADROOM * largest + f32::MIN_POSITIVE,
    }
}

impl Kernel for MollerTrumbore {
    type Record = [[f32; 3]; 3];
    type Prepared = ();

    #[inline]
    fn record(vertices: [[f32; 3]; 3]) -> Self::Record {
        flat_as_edge(vertices)
    }

    #[inline]
    fn prepare(_: &ScaledRay) {}

    #[inline]
    fn intersect((): &(), ray: &ScaledRay, vertices: &Self::Record, t_max: f32) -> Option<TriangleHit> {
        if weights(ray, vertices).misses() {
            return None;
        }
        finish(ray, vertices, t_max)
    }
}

/// Result of an f32 filter for a line and a triangle: barycentric coordinates times a determinant, and their error.
///
/// Holds: if `finish` accepts the triangle, then [`misses`](Self::misses) is false. For that, `error` must bound, in
/// units of `det`, the sum of
/// - the rounding of `u`, of `v` and of `u + v`, each with that of `det`, whose sign may then be wrong, too;
/// - `WEIGHT_SLACK·|det|`, the tolerance of `finish` for coordinates outside the triangle.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Proportional to the normal times the direction; positive or negative.
    pub det: f32,
    /// Coordinate of the second vertex, times `det`.
    pub u: f32,
    /// Coordinate of the third vertex, times `det`.
    pub v: f32,
    /// The bound; infinite if a product may have overflowed.
    pub error: f32,
}

impl Weights {
    /// Whether the line is certain to miss the triangle.
    #[inline]
    pub fn misses(&self) -> bool {
        let sign = 1.0f32.copysign(self.det);
        let (u, v) = (sign * self.u, sign * self.v);
        // NaN is left to `finish`.
        u < -self.error || v < -self.error || u + v > self.det.abs() + self.error
    }
}

/// Sum of the absolute components, cheaper than their maximum.
#[inline]
pub(super) fn norm([x, y, z]: [f32; 3]) -> f32 {
    x.abs() + y.abs() + z.abs()
}

/// Tolerance below zero of a barycentric coordinate: what the f32 filters pass at an edge is a hit.
const WEIGHT_SLACK: f64 = 4.0 * UNIT_ROUNDOFF as f64;

/// Tolerance, relative to the greatest `|v - o|∞`, between the point on the ray and the point by barycentric coordinates.
///
/// Rounding `t` to f32 takes one u; the other u is for the f64 solution, which exceeds it only for a ray within about 1e-8
/// of the plane of the face or a triangle that thin.
const AGREEMENT: f64 = 2.0 * UNIT_ROUNDOFF as f64;

/// The f64 test of what an f32 filter passes; the same bits for every filter.
///
/// Reads: a ray, three vertices. Writes: the hit.
/// Holds: accepted points lie within 18.1 u of the triangle, relative to the greatest `|v - o|∞` of its vertices (below).
/// Source: Möller, Trumbore 1997; the check of the solution by substitution is ours.
///
/// # Error
/// The solution of `o + t·d = v0 + u·(v1 - v0) + v·(v2 - v0)` is substituted: both sides must agree within
/// `AGREEMENT`, relative to `M`, the greatest `|v - o|∞`. So the condition of the system does not matter, and a zero determinant
/// fails. The coordinates are at least -4u; at most two are negative, and edges are at most 2M, so moving them to zero moves the
/// point by at most `8u·M` twice. In all `18u·M`, and less than 0.1 u for the roundings of the check itself: differences of
/// coordinates are off by 2^-53 relative, and so is all that follows.
#[inline]
pub fn finish(ray: &ScaledRay, vertices: &[[f32; 3]; 3], t_max: f32) -> Option<TriangleHit> {
    let [v0, v1, v2] = vertices.map(to_f64);
    let (o, d) = (to_f64(ray.origin), to_f64(ray.direction));
    let (e1, e2, s) = (sub(v1, v0), sub(v2, v0), sub(o, v0));
    let p = cross(d, e2);
    let q = cross(s, e1);
    // The determinant is minus the normal times the direction.
    let det = dot(p, e1);
    let u = dot(p, s) / det;
    let v = dot(q, d) / det;
    // Also true for NaN.
    if !(u >= -WEIGHT_SLACK && v >= -WEIGHT_SLACK && u + v <= 1.0 + WEIGHT_SLACK) {
        return None;
    }
    let t = nearest(dot(q, e2) / det);
    if !(ray.t_min <= t && t <= t_max) {
        return None;
    }
    let scale = reach(s).max(reach(sub(o, v1))).max(reach(sub(o, v2)));
    // The second term covers an underflow of `t`.
    let agreement = AGREEMENT * scale + f64::from(f32::MIN_POSITIVE) * 0.25;
    let agrees = (0..3).all(|k| {
        let on_ray = s[k] + f64::from(t) * d[k];
        let by_weights = u * e1[k] + v * e2[k];
        (on_ray - by_weights).abs() <= agreement
    });
    let side = if det > 0.0 { Side::Front } else { Side::Back };
    agrees.then(|| TriangleHit { t, u: nearest(u.clamp(0.0, 1.0)), v: nearest(v.clamp(0.0, 1.0)), side })
}
