//! Ray-box tests that miss no hit.
//!
//! # Guarantee
//! Let a triangle lie in a box, and let a kernel report `t` with `t_min <= t <= t_max`. Then the test reports the box, with
//! an entry of at most `t`. Hence a traversal that skips boxes entered after the best hit so far finds the same hit as a loop
//! over all triangles, ties included.
//!
//! # Where the padding is
//! The padding has two parts: one relative to `|o|∞`, the greatest coordinate of the ray's origin, and one relative to ρ∞,
//! that of the vertices *in this box*. The ray carries the first. The second is either part of the box, once and for all
//! rays ([`pad_aabb`], [`Slabs::padded`]), or of the ray, as the `reach` given to [`SlabRay::new`]. A BVH stores padded
//! boxes, so a large triangle does not loosen the boxes of small ones.
//!
//! # Proof
//! Let u = 2^-24 and `S = |o|∞ + ρ∞`. `P = o + t·d` lies within `e` of the triangle in each coordinate. All coordinates may be relative to a
//! [`ReferencePoint`](crate::ReferencePoint): then `e = (HIT_ERROR + u)·S`, and else `HIT_ERROR·S`. So
//! `t·|d|∞ <= |P - o|∞ <= S + e`. The greatest `|d_k|` lies in [1, 2), so also `t <= S + e`.
//!
//! *Axis-aligned boxes.* `P_k >= lo - e`. A component `|d_k|` below 2^-64 is replaced by ±2^-64, which moves `P_k` by at
//! most 2^-63·t. Let `c` be [`AABB_PAD`] and `lo⁻ <= lo - c·ρ∞` the stored plane. It is hit at
//! `fl(fl(lo⁻ - o⁺)·fl(1/d))` with `o⁺ = fl(o + c·|o|∞)`; let `d > 0` and `x = (lo⁻ - o⁺)/d`, exactly. If `x <= 0`, so is the
//! computed value, and `t >= t_min >= 0` is no smaller. Otherwise `0 < lo⁻ - o⁺ <= lo - o <= S`, and three roundings exceed
//! `x` by at most 3.01 u·S/d. So the computed value is at most `t` if `(lo - lo⁻) + (o⁺ - o) >= e + 3.01 u·S + 2^-62·S`. The
//! left side is at least `c·S` less the rounding of `o⁺`, at most u·S, so `c = HIT_ERROR + 6u` suffices, with nearly u·S to
//! spare for the roundings of `c·|o|∞` and `c·ρ∞` and all second-order terms. The upper plane is hit from
//! `o⁻ = fl(o - c·|o|∞)`: its exact `t` is greater by as much, and three roundings of a distance of at most `(1 + c)·S` leave
//! it above. For `d < 0` the planes swap roles. `lo⁻ - o⁺ < hi⁺ - o⁻`, so the smaller of the two values is always the entry.
//! Where the ray carries both parts, `lo⁻ = lo` and `o⁺ = fl(o + c·S)`: the same sum.
//!
//! *Oriented boxes.* For a row of length at most 1 + 4u, `|row|₁ <= √3·(1 + 4u)`. The box holds the triangle, so
//! `row·P >= lo - √3·e`. The projected ray is `o' = fl(row·o)` and `d' = fl(row·d)`, three roundings each: at `t` it is
//! off by at most `√3·(3u·|o|∞ + 3u·t·|d|∞) <= √3·6u·S`. The sign of `d'`, or a `d'` of zero, does not matter: only the
//! position at `t` enters. The moved origin `o' ± ε` costs √3·u·S, the planes' three roundings √3·3.01 u·S as above, for
//! `0 < lo⁻ - o'⁺` means `lo⁻ - o'⁺ <= √3·S`. So `√3·(HIT_ERROR + 12u)·S` suffices for both parts together, again with u to
//! spare: [`SLABS_PAD`].
//!
//! Underflow loses a few 2^-149 in position; the smallest normal number is added to every pad of a ray, and padded planes
//! are rounded outward. Planes are finite and `|1/d| <= 2^64`, so no test produces a NaN.
//!
//! Source: the slab test of Kay, Kajiya 1986; conservative bounds after Ize 2013, extended from exact rays to rotated rays
//! and inexact hits.

mod slab_ray;
mod slabs;

pub use slab_ray::reciprocal;
pub use slab_ray::{MIN_DIRECTION, SlabRay};
pub use slabs::Slabs;

use canted_obb::{Aabb, Obb};

use crate::rounding::{UNIT_ROUNDOFF, lower};
use crate::{HIT_ERROR, Ray, ScaledRay};

/// Padding of axis-aligned boxes, relative to `|o|∞ + ρ∞`.
///
/// The error of hits, one rounding of coordinates relative to a [`ReferencePoint`](crate::ReferencePoint), one of the moved origin,
/// three of a plane's `t`, and one for second-order terms.
pub const AABB_PAD: f32 = HIT_ERROR + 6.0 * UNIT_ROUNDOFF;

/// Square root of three, rounded up: the greatest sum of absolute components of a unit vector.
pub const SQRT_3: f32 = 1.732_050_9;

/// Padding of oriented boxes, relative to `|o|∞ + ρ∞`.
///
/// As [`AABB_PAD`], with three roundings each for the projected origin and direction, along a row whose components sum
/// to √3 at most.
pub const SLABS_PAD: f32 = SQRT_3 * (HIT_ERROR + 12.0 * UNIT_ROUNDOFF);

/// `aabb` enlarged by the part of the padding that depends on its content, for [`SlabRay::new`] with a reach of 0.
///
/// The planes move outward by [`AABB_PAD`] times `reach`, the greatest absolute coordinate of the triangles in the box:
/// [`Aabb::reach`] of a tight box. An empty box must not be padded.
#[must_use]
pub fn pad_aabb(aabb: &Aabb, reach: f32) -> Aabb {
    let pad = f64::from(AABB_PAD) * f64::from(reach);
    Aabb { min: aabb.min.map(|x| lower(x, pad)), max: aabb.max.map(|x| -lower(-x, pad)) }
}

/// Entry and exit of `ray` through `aabb`, in units of the ray's direction and clipped to its interval; `None` for a
/// certain miss, an empty box, or an invalid ray.
///
/// Conservative: every representable `t` of the interval whose point lies in the box is between the two. The box is
/// enlarged by up to 26 u = 1.6e-6 times the greatest coordinates of box and origin.
#[must_use]
pub fn ray_aabb(ray: &Ray, aabb: &Aabb) -> Option<(f32, f32)> {
    if aabb.is_empty() {
        return None;
    }
    let ray = ScaledRay::new(ray)?;
    let (near, far) = SlabRay::new(&ray, aabb.reach()).clip_aabb(aabb, ray.t_max);
    (near <= far).then(|| (ray.caller_t(near), ray.caller_t(far)))
}

/// Entry and exit of `ray` through `obb`, like [`ray_aabb`]; the box may be flat or skewed.
///
/// For many rays against one box, prepare a [`Slabs`] and use [`SlabRay::intersect_slabs`].
#[must_use]
pub fn ray_obb(ray: &Ray, obb: &Obb) -> Option<(f32, f32)> {
    let ray = ScaledRay::new(ray)?;
    let (near, far) = SlabRay::new(&ray, obb.aabb().reach()).clip_slabs(&Slabs::from_obb(obb), ray.t_max);
    (near <= far).then(|| (ray.caller_t(near), ray.caller_t(far)))
}
