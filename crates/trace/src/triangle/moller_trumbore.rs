use super::filter::{Weights, norm};
use super::finish::finish;
use super::{Kernel, TriangleHit};
use crate::ScaledRay;
use crate::rounding::UNIT_ROUNDOFF;
use canted_obb::vector::{cross, dot, sub};

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
