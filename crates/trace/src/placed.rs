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

use canted_obb::Affine;
use canted_obb::round::{greatest, magnitude_down, magnitude_up, power_below, reciprocal_of_power};
use canted_obb::vector::{cross, dot, to_f64};

use crate::{Hit, InstanceId, Mapped, Query, Ray, ScaledRay};

/// The map of an instance, and what its inverse needs.
///
/// The inverse by cofactors in `f64` takes fewer operations than it has numbers, so it is computed for each ray: from half a cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct ObjectMap {
    /// Rows of the map to world space, each with its translation last.
    rows: [[f32; 4]; 3],
    /// One over the determinant; 0 for a map that no ray is mapped by.
    reciprocal: f64,
}

impl ObjectMap {
    /// The map of an instance, which is invertible.
    #[must_use]
    pub fn new(world_from_object: &Affine) -> Self {
        let [a, b, c, _] = world_from_object.columns.map(to_f64);
        Self { rows: world_from_object.rows(), reciprocal: 1.0 / dot(a, cross(b, c)) }
    }

    /// The map of an instance that no ray can hit.
    #[must_use]
    pub fn hidden(world_from_object: &Affine) -> Self {
        Self { rows: world_from_object.rows(), reciprocal: 0.0 }
    }

    /// Whether no ray can hit the instance.
    #[inline]
    #[must_use]
    pub fn is_hidden(&self) -> bool {
        self.reciprocal == 0.0
    }

    /// The map, as it was given.
    #[must_use]
    pub fn world_from_object(&self) -> Affine {
        Affine::from_rows(self.rows)
    }

    /// The origin and the direction of a ray in object space.
    ///
    /// The columns of the inverse are cross products of the rows of the map, over its determinant: the same products and differences as those of its
    /// rows, so the same bits. Lanes are independent, so that the compiler may use vectors of any width; the last is not used.
    #[inline(always)]
    fn inverse_of(&self, origin: [f32; 3], direction: [f32; 3]) -> [[f64; 3]; 2] {
        let [x, y, z] = [lanes(&self.rows[0]), lanes(&self.rows[1]), lanes(&self.rows[2])];
        let s = self.reciprocal;
        let (a, b, c) = (times(crossed(y, z), s), times(crossed(z, x), s), times(crossed(x, y), s));
        let shift = linear(a, b, c, [x[3], y[3], z[3]]);
        let [ox, oy, oz] = origin;
        let o = linear(a, b, c, [f64::from(ox), f64::from(oy), f64::from(oz)]);
        let [dx, dy, dz] = direction;
        let d = linear(a, b, c, [f64::from(dx), f64::from(dy), f64::from(dz)]);
        [[o[0] - shift[0], o[1] - shift[1], o[2] - shift[2]], [d[0], d[1], d[2]]]
    }
}

#[inline(always)]
fn lanes([x, y, z, w]: &[f32; 4]) -> [f64; 4] {
    [f64::from(*x), f64::from(*y), f64::from(*z), f64::from(*w)]
}

#[inline(always)]
fn crossed(p: [f64; 4], q: [f64; 4]) -> [f64; 4] {
    let (p_1, q_2) = ([p[1], p[2], p[0], p[3]], [q[2], q[0], q[1], q[3]]);
    let (p_2, q_1) = ([p[2], p[0], p[1], p[3]], [q[1], q[2], q[0], q[3]]);
    [
        p_1[0] * q_2[0] - p_2[0] * q_1[0],
        p_1[1] * q_2[1] - p_2[1] * q_1[1],
        p_1[2] * q_2[2] - p_2[2] * q_1[2],
        p_1[3] * q_2[3] - p_2[3] * q_1[3],
    ]
}

#[inline(always)]
fn times(v: [f64; 4], s: f64) -> [f64; 4] {
    [v[0] * s, v[1] * s, v[2] * s, v[3] * s]
}

#[inline(always)]
fn linear(a: [f64; 4], b: [f64; 4], c: [f64; 4], v: [f64; 3]) -> [f64; 4] {
    [
        (a[0] * v[0] + b[0] * v[1]) + c[0] * v[2],
        (a[1] * v[0] + b[1] * v[1]) + c[1] * v[2],
        (a[2] * v[0] + b[2] * v[1]) + c[2] * v[2],
        (a[3] * v[0] + b[3] * v[1]) + c[3] * v[2],
    ]
}

/// A world-space ray whose direction is scaled by a power of two; `t` is scaled, and exact.
#[derive(Clone, Copy, Debug)]
pub struct WorldRay<'a> {
    /// The ray, its interval rounded inward.
    pub ray: &'a ScaledRay,
    t_min: f64,
    /// The end of the interval.
    pub t_max: f64,
    /// The caller's `t` over the scaled one.
    from_scaled: f64,
}

impl<'a> WorldRay<'a> {
    /// See the type.
    #[inline(always)]
    #[must_use]
    pub fn new(ray: &'a ScaledRay) -> Self {
        let [t_min, t_max] = ray.exact_interval();
        Self { ray, t_min, t_max, from_scaled: reciprocal_of_power(ray.scale()) }
    }

    /// The interval rounded outward, for boxes of the top level.
    #[inline(always)]
    #[must_use]
    pub fn interval(&self) -> [f32; 2] {
        [magnitude_down(self.t_min), magnitude_up(self.t_max)]
    }

    /// The ray from `origin` along `direction` in object space, which are those of the instance but for the length of the
    /// direction, with hits up to the scaled `t_max`. `None` where no `f32` lies in the interval, or the origin is beyond the range.
    #[inline(always)]
    #[must_use]
    pub fn in_object(&self, origin: [f64; 3], direction: [f64; 3], t_max: f64) -> Option<ObjectRay> {
        let [dx, dy, dz] = direction;
        let to_object = power_below_rounded(greatest([dx.abs(), dy.abs(), dz.abs()]));
        let to_world = reciprocal_of_power(to_object);
        let [x, y, z] = origin;
        let origin = [x as f32, y as f32, z as f32];
        let direction = [(dx * to_world) as f32, (dy * to_world) as f32, (dz * to_world) as f32];
        // Inward: the `t` of a bottom-level BVH is an f32, so these are the same hits as in the exact interval. Most rays start at zero.
        let t_min = if self.t_min == 0.0 { 0.0 } else { magnitude_up(self.t_min * to_object) };
        let t_max = magnitude_down(t_max * to_object);
        // No component is NaN.
        let reach = greatest([origin[0].abs(), origin[1].abs(), origin[2].abs()]);
        if !((t_min <= t_max) & (reach < f32::INFINITY)) {
            return None;
        }
        let &ScaledRay { time, mask, .. } = self.ray;
        let ray = Ray { origin, direction, t_min, t_max, time, mask };
        let ray = ScaledRay::from_parts(&ray, [t_min, t_max], 1.0);
        Some(ObjectRay { ray, to_world, to_caller: to_world * self.from_scaled })
    }

    /// The caller's `t` of a scaled one, rounded.
    #[inline]
    #[must_use]
    pub fn caller_t(&self, scaled_t: f64) -> f32 {
        (scaled_t * self.from_scaled) as f32
    }
}

/// The power of two at or below a positive normal number once that is rounded to the digits of an `f32`.
///
/// Half a last digit of an `f32` is added to the bits, which carries into the exponent where rounding does: of two nearest ones the power
/// of two is even.
#[inline(always)]
fn power_below_rounded(x: f64) -> f64 {
    const HALF_DIGIT: u64 = 1 << (f64::MANTISSA_DIGITS - f32::MANTISSA_DIGITS - 1);
    power_below(f64::from_bits(x.to_bits() + HALF_DIGIT))
}

/// A world-space ray, and the instance that it enters.
#[derive(Clone, Copy, Debug)]
pub struct PlacedRay<'a> {
    /// The ray.
    pub world: &'a WorldRay<'a>,
    /// The map of the instance.
    pub map: &'a ObjectMap,
    /// The greatest scaled `t` of a hit.
    pub t_max: f64,
}

impl PlacedRay<'_> {
    /// The ray in object space; `None` where its interval is empty.
    #[inline(always)]
    #[must_use]
    pub fn object(&self) -> Option<ObjectRay> {
        let ScaledRay { origin, direction, .. } = self.world.ray;
        let [origin, direction] = self.map.inverse_of(*origin, *direction);
        self.world.in_object(origin, direction, self.t_max)
    }
}

/// A ray in the object space of an instance, with a direction whose greatest component lies in `[1, 2)`, as the caller's.
#[derive(Clone, Copy, Debug)]
pub struct ObjectRay {
    /// The ray.
    pub ray: ScaledRay,
    /// Scaled world `t` over object `t`.
    to_world: f64,
    /// The caller's `t` over object `t`.
    to_caller: f64,
}

impl ObjectRay {
    /// The scaled world `t` of an object `t`, exactly.
    #[inline]
    #[must_use]
    pub fn world_t(&self, t: f32) -> f64 {
        f64::from(t) * self.to_world
    }

    /// Calls `ask` with the caller's query, for hits in object space.
    #[inline(always)]
    pub fn ask<R>(&self, query: &mut dyn Query, instance: InstanceId, ask: impl FnOnce(&mut dyn Query) -> R) -> R {
        if !query.may_reject() {
            return ask(query);
        }
        let map = |hit: &Hit| Hit { t: (f64::from(hit.t) * self.to_caller) as f32, instance, ..*hit };
        ask(&mut Mapped { query, map })
    }

    /// The closest hit of the instance, with its scaled world `t`; `find` looks for it in object space.
    #[inline]
    pub fn closest_hit(
        &self,
        query: &mut dyn Query,
        instance: InstanceId,
        find: impl FnOnce(&ScaledRay, &mut dyn Query) -> Option<Hit>,
    ) -> Option<(f64, Hit)> {
        let hit = self.ask(query, instance, |query| find(&self.ray, query))?;
        Some((self.world_t(hit.t), Hit { instance, ..hit }))
    }

    /// Whether the instance is hit, which `find` finds out in object space.
    #[inline]
    pub fn occluded(
        &self,
        query: &mut dyn Query,
        instance: InstanceId,
        find: impl FnOnce(&ScaledRay, &mut dyn Query) -> bool,
    ) -> bool {
        self.ask(query, instance, |query| find(&self.ray, query))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_numbers_have_the_power_of_two_of_their_f32() {
        let mut n_carried = 0;
        for exponent in [-131, -1, 0, 100] {
            let power = 2_f64.powi(exponent);
            // Around 2 - 2^-24, which is as far from both nearest numbers.
            for steps in -3_i64..=3 {
                let x = f64::from_bits((power * (2.0 - 2_f64.powi(-24))).to_bits().wrapping_add_signed(steps));
                let rounded = f64::from((x / power) as f32) * power;
                assert_eq!(power_below_rounded(x), power_below(rounded), "{x:e}");
                n_carried += usize::from(power_below(x) != power_below(rounded));
            }
            for x in [power, 1.5 * power, (power * 2.0).next_down(), power.next_up()] {
                assert_eq!(power_below_rounded(x), power_below(f64::from((x / power) as f32) * power), "{x:e}");
            }
        }
        assert_eq!(n_carried, 16);
    }
}
