use canted_obb::Aabb;

use super::slabs::Slabs;
use super::{AABB_PAD, SLABS_PAD, SQRT_3};
use crate::rounding::up;
use crate::{HIT_ERROR, ScaledRay};
use canted_obb::vector::{dot, to_f64};

/// Minimum absolute component of a direction in a box test, 2^-64; smaller components, and zero, are replaced by it.
///
/// A power of two, so that scaling a scene by one changes no bit. It moves a point of the ray by less than 2^-62 of the
/// scene.
pub const MIN_DIRECTION: f32 = 1.0 / (1u128 << 64) as f32;

/// A ray prepared for the boxes of one space, with the padding for the error of hits.
///
/// The accessors let SIMD code repeat the arithmetic of [`SlabRay::intersect_aabb`] and [`SlabRay::intersect_slabs`] lane
/// by lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlabRay {
    origin: [f32; 3],
    direction: [f32; 3],
    origin_lo: [f32; 3],
    origin_hi: [f32; 3],
    recip: [f32; 3],
    pad_oriented: f32,
    t_min: f32,
}

impl SlabRay {
    /// Prepares `ray` for boxes of triangles whose absolute coordinates do not exceed `reach`; 0 for boxes that carry their own
    /// part of the padding, from [`pad_aabb`](crate::pad_aabb) and [`Slabs::padded`].
    ///
    /// The boxes themselves may extend farther. With a smaller `reach` hits may be missed.
    #[inline]
    #[must_use]
    pub fn new(ray: &ScaledRay, reach: f32) -> Self {
        let [x, y, z] = ray.origin.map(f32::abs);
        let scale = max(x, max(y, z)) + reach;
        Self::with_pads(ray, AABB_PAD * scale + f32::MIN_POSITIVE, SLABS_PAD * scale + f32::MIN_POSITIVE)
    }

    /// Prepares `ray` for boxes of primitives whose hits have an absolute error of `error` in each coordinate.
    ///
    /// For primitives other than triangles of this space: `error` replaces `HIT_ERROR·(|o|∞ + ρ∞)` in the proof. `reach` as
    /// for [`SlabRay::new`]; a padded box covers the roundings relative to its content, and more.
    #[inline]
    #[must_use]
    pub fn with_error(ray: &ScaledRay, reach: f32, error: f64) -> Self {
        // The error adds to the distance of the hit, so the roundings are relative to it too.
        let scale = canted_obb::vector::reach(to_f64(ray.origin)) + f64::from(reach) + error;
        let pad = error + f64::from(AABB_PAD - HIT_ERROR) * scale;
        let pad_oriented = f64::from(SQRT_3) * error + f64::from(SLABS_PAD - SQRT_3 * HIT_ERROR) * scale;
        Self::with_pads(ray, up(pad) + f32::MIN_POSITIVE, up(pad_oriented) + f32::MIN_POSITIVE)
    }

    /// Prepares `ray` with absolute padding.
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn with_pads(ray: &ScaledRay, pad: f32, pad_oriented: f32) -> Self {
        Self {
            origin: ray.origin,
            direction: ray.direction,
            origin_lo: ray.origin.map(|o| o + pad),
            origin_hi: ray.origin.map(|o| o - pad),
            recip: ray.direction.map(reciprocal),
            pad_oriented,
            t_min: ray.t_min,
        }
    }

    /// The scaled `t` at which the ray enters `aabb`, at most that of any hit inside; `None` for a certain miss.
    ///
    /// `aabb` must not be empty.
    #[inline]
    #[must_use]
    pub fn intersect_aabb(&self, aabb: &Aabb, t_max: f32) -> Option<f32> {
        let (near, far) = self.clip_aabb(aabb, t_max);
        (near <= far).then_some(near)
    }

    /// The scaled `t` at which the ray enters `slabs`, at most that of any hit inside; `None` for a certain miss.
    ///
    /// `slabs` must not be empty.
    #[inline]
    #[must_use]
    pub fn intersect_slabs(&self, slabs: &Slabs, t_max: f32) -> Option<f32> {
        let (near, far) = self.clip_slabs(slabs, t_max);
        (near <= far).then_some(near)
    }

    /// Entry and exit; a miss if the entry is greater.
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn clip_aabb(&self, aabb: &Aabb, t_max: f32) -> (f32, f32) {
        let mut interval = (self.t_min, t_max);
        for k in 0..3 {
            let t_lo = (aabb.min[k] - self.origin_lo[k]) * self.recip[k];
            let t_hi = (aabb.max[k] - self.origin_hi[k]) * self.recip[k];
            interval = clip(interval, t_lo, t_hi);
        }
        interval
    }

    /// Entry and exit; a miss if the entry is greater.
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn clip_slabs(&self, slabs: &Slabs, t_max: f32) -> (f32, f32) {
        let mut interval = (self.t_min, t_max);
        for k in 0..3 {
            let origin = dot(slabs.rows[k], self.origin);
            let recip = reciprocal(dot(slabs.rows[k], self.direction));
            let t_lo = (slabs.lo[k] - (origin + self.pad_oriented)) * recip;
            let t_hi = (slabs.hi[k] - (origin - self.pad_oriented)) * recip;
            interval = clip(interval, t_lo, t_hi);
        }
        interval
    }

    /// The origin, for projection on the rows of oriented boxes.
    #[inline]
    #[must_use]
    pub fn origin(&self) -> [f32; 3] {
        self.origin
    }

    /// The scaled direction, for projection on the rows of oriented boxes.
    #[inline]
    #[must_use]
    pub fn direction(&self) -> [f32; 3] {
        self.direction
    }

    /// The padded origin for lower planes of axis-aligned boxes.
    #[inline]
    #[must_use]
    pub fn origin_lo(&self) -> [f32; 3] {
        self.origin_lo
    }

    /// The padded origin for upper planes of axis-aligned boxes.
    #[inline]
    #[must_use]
    pub fn origin_hi(&self) -> [f32; 3] {
        self.origin_hi
    }

    /// Reciprocals of the direction, bounded by [`MIN_DIRECTION`].
    #[inline]
    #[must_use]
    pub fn recip(&self) -> [f32; 3] {
        self.recip
    }

    /// The padding of a projected origin for oriented boxes: added for lower planes, subtracted for upper ones.
    #[inline]
    #[must_use]
    pub fn pad_oriented(&self) -> f32 {
        self.pad_oriented
    }

    /// Minimum scaled `t`.
    #[inline]
    #[must_use]
    pub fn t_min(&self) -> f32 {
        self.t_min
    }
}

/// `1/d`, bounded; the same for both zeros.
#[inline(always)]
#[must_use]
pub fn reciprocal(d: f32) -> f32 {
    // Adding zero makes -0.0 positive.
    let d = d + 0.0;
    1.0 / max(d.abs(), MIN_DIRECTION).copysign(d)
}

/// The interval clipped by two planes, in either order.
#[inline]
fn clip((near, far): (f32, f32), t_lo: f32, t_hi: f32) -> (f32, f32) {
    (max(near, min(t_lo, t_hi)), min(far, max(t_lo, t_hi)))
}

/// The minimum in one instruction, without NaN handling.
#[inline]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The maximum in one instruction, without NaN handling.
#[inline]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
