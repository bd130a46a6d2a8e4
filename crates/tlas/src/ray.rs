//! Rays through instances: directions of any length, and every `t` exact.
//!
//! ```text
//! caller's ray -> ScaledRay: direction times a power of two -> ObjectRay: mapped, times another -> bottom-level BVH
//! caller's t   <- rounded once, at the end                  <- an f32 times a power of two, exact in f64
//! ```
//!
//! A `t` in object space is an `f32`, that of the bottom-level BVH for a direction whose greatest component lies in `[1, 2)`. In
//! world space it is that number times a power of two, which `f64` holds exactly, as it holds both ends of the caller's
//! interval. So hits of different instances are compared without rounding, and multiplying a direction by a power of two
//! changes nothing but the `t` that is reported.
//!
//! # Exponents
//! The power of two of the caller's direction is from 2^-149 to 2^127. That of an instance is the length of a mapped direction:
//! as the norm of a transform is below 2^130 and at least 2^-149, and its condition at most 2^20, it is from 2^-131 to 2^172. A
//! `t` is from 2^-149 to 2^128. So every product lies between 2^-430 and 2^430, in the range of `f64`.

use canted_obb::round::{down, greatest, power_below, reciprocal_of_power, up};
use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

/// A world-space ray whose direction is scaled by a power of two; `t` is scaled, and exact.
pub(crate) struct WorldRay {
    /// The ray for boxes of the top level, its interval rounded outward.
    pub(crate) top: ScaledRay,
    t_min: f64,
    pub(crate) t_max: f64,
    /// The caller's `t` over the scaled one.
    from_scaled: f64,
}

impl WorldRay {
    #[inline(always)]
    pub(crate) fn new(ray: &ScaledRay) -> Self {
        let [t_min, t_max] = ray.exact_interval();
        let mut top = *ray;
        (top.t_min, top.t_max) = (down(t_min), up(t_max));
        Self { top, t_min, t_max, from_scaled: reciprocal_of_power(ray.scale()) }
    }

    /// The ray from `origin` along `direction` in object space, which are those of the instance but for the length of the
    /// direction, with hits up to the scaled `t_max`. `None` where no `f32` lies in the interval, or the origin is beyond the range.
    #[inline(always)]
    pub(crate) fn in_object(&self, origin: [f64; 3], direction: [f64; 3], t_max: f64) -> Option<ObjectRay> {
        let greatest = greatest(direction.map(f64::abs));
        let mut to_object = power_below(greatest);
        // Rounding may reach 2; the greatest component is then 1.
        if (greatest * reciprocal_of_power(to_object)) as f32 >= 2.0 {
            to_object *= 2.0;
        }
        let to_world = reciprocal_of_power(to_object);
        let (origin, direction) = (origin.map(|o| o as f32), direction.map(|d| (d * to_world) as f32));
        // Inward: the `t` of a bottom-level BVH is an f32, so these are the same hits as in the exact interval.
        let (t_min, t_max) = (up(self.t_min * to_object), down(t_max * to_object));
        let [x, y, z] = origin.map(f32::is_finite);
        if !((t_min <= t_max) & x & y & z) {
            return None;
        }
        let ScaledRay { time, mask, .. } = self.top;
        let ray = Ray { origin, direction, t_min, t_max, time, mask };
        let ray = ScaledRay::from_parts(&ray, [t_min, t_max], 1.0);
        Some(ObjectRay { ray, to_world, to_caller: to_world * self.from_scaled })
    }

    /// The caller's `t` of a scaled one, rounded.
    #[inline]
    pub(crate) fn caller_t(&self, scaled_t: f64) -> f32 {
        (scaled_t * self.from_scaled) as f32
    }
}

/// A ray in the object space of an instance, with a direction whose greatest component lies in `[1, 2)`, as the caller's.
pub(crate) struct ObjectRay {
    pub(crate) ray: ScaledRay,
    /// Scaled world `t` over object `t`.
    to_world: f64,
    /// The caller's `t` over object `t`.
    to_caller: f64,
}

impl ObjectRay {
    /// The scaled world `t` of an object `t`, exactly.
    #[inline]
    pub(crate) fn world_t(&self, t: f32) -> f64 {
        f64::from(t) * self.to_world
    }

    /// Calls `ask` with the caller's query, for hits in object space.
    #[inline(always)]
    pub(crate) fn ask<R>(
        &self,
        query: &mut dyn Query,
        instance: InstanceId,
        ask: impl FnOnce(&mut dyn Query) -> R,
    ) -> R {
        if !query.may_reject() {
            return ask(query);
        }
        ask(&mut InInstance { query, instance, to_caller: self.to_caller })
    }
}

/// Passes hits with the instance and the caller's `t` on to a query.
struct InInstance<'a> {
    query: &'a mut dyn Query,
    instance: InstanceId,
    to_caller: f64,
}

impl Query for InInstance<'_> {
    fn counts(&self) -> bool {
        self.query.counts()
    }

    fn boxes(&mut self, n: u32) {
        self.query.boxes(n);
    }

    fn triangles(&mut self, n: u32) {
        self.query.triangles(n);
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        let t = (f64::from(hit.t) * self.to_caller) as f32;
        self.query.accepts(&Hit { t, instance: self.instance, ..*hit })
    }
}
