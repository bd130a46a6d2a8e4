use super::filter::{Weights, greatest};
use super::finish::finish;
use super::{Kernel, TriangleHit};
use crate::ScaledRay;
use crate::rounding::UNIT_ROUNDOFF;
use crate::vector::{cross, dot, sub};

/// Error of the weights, relative to `E·(S + E)`, see below.
const ERROR: f32 = 194.0 * UNIT_ROUNDOFF;

/// No number of the filter exceeds `HEADROOM·E·(S + E)`: where that is finite, nothing overflows.
const HEADROOM: f32 = 32.0;

/// The kernel that needs nothing precomputed; of rays exactly through shared edges it promises nothing.
///
/// Reads: a ray, three vertices. Writes: the hit.
/// Holds: reported points lie within [`HIT_ERROR`](crate::HIT_ERROR); hits have the bits of
/// [`BaldwinWeber`](crate::BaldwinWeber)'s. Rays within about 1e-8 of the face's plane miss. The filter loses nothing
/// that the finish accepts, at any scale.
/// Source: Möller, Trumbore 1997, without culling; the distance is left to f64, so that a traversal's shrinking
/// `t_max` cannot change which triangles are hit. The error bound of the filter is ours.
///
/// # Error of the filter
/// Let u = 2^-24, `E` the greatest component of both edges, `S` that of `s = o - v0`; the direction's are below 2.
/// - Edges and `s` are off by u, relative. A component of `p = d x e2` has two terms of at most `2E` with three
///   roundings each (edge, product, difference): 12 u·E, and `|p| <= 4E`.
/// - `det = p·e1` has three terms: 12 u·E·E each from `p`, and four roundings (edge, product, two sums) of `4E·E`:
///   together 84 u·E·E. Likewise `p·s` is off by 84 u·E·S, and so is `(s x e1)·d`, whose cross product has a rounding
///   more and whose dot product one less. None of the three exceeds 12 times its `E·E` or `E·S`.
/// - `u + v` is off by 2·84 u·E·S, and rounding the sum adds 24 u·E·S. With the 84 of `det` and the finish's
///   4 u·|det| <= 48 u·E·E, all is within `u·E·(192 S + 132 E)`. The rest of `ERROR` is for second-order terms and for
///   the finish's own f64 roundings.
/// - A product that underflows is off by 2^-150 at most. Two in each component of a cross product and three in each
///   dot product make less than `18·2^-150·(S + E + 2)`: less than `MIN_POSITIVE`, added to `E` and to the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MollerTrumbore;

/// The weights of the ray's line; `det` is minus the normal times the direction.
#[inline]
pub(crate) fn weights(ray: &ScaledRay, [v0, v1, v2]: &[[f32; 3]; 3]) -> Weights {
    let (e1, e2, s) = (sub(*v1, *v0), sub(*v2, *v0), sub(ray.origin, *v0));
    let p = cross(ray.direction, e2);
    let edges = greatest(e1).max(greatest(e2)) + f32::MIN_POSITIVE;
    let largest = HEADROOM * (edges * (greatest(s) + edges));
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
        vertices
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
