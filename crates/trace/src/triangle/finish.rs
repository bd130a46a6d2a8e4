use super::TriangleHit;
use crate::rounding::{UNIT_ROUNDOFF, nearest};
use crate::{ScaledRay, Side};
use canted_obb::vector::{cross, dot, reach, sub, to_f64};

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
