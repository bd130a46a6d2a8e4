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

    /// The origin and the direction of a ray in object space, each as its z, x, y and a number that is not used.
    ///
    /// The columns of the inverse are cross products of the rows of the map, over its determinant: the same products and differences as those of its
    /// rows, so the same bits.
    #[inline(always)]
    fn inverse_of<L: F64x4>(&self, lanes: L, origin: [f32; 3], direction: [f32; 3]) -> [L::V; 2] {
        let [[.., x_w], [.., y_w], [.., z_w]] = self.rows;
        let rows = [lanes.widen(&self.rows[0]), lanes.widen(&self.rows[1]), lanes.widen(&self.rows[2])];
        let [x, y, z] =
            [(rows[0], lanes.rotate(rows[0])), (rows[1], lanes.rotate(rows[1])), (rows[2], lanes.rotate(rows[2]))];
        let s = lanes.splat(self.reciprocal);
        let columns = [
            lanes.mul(crossed(lanes, y, z), s),
            lanes.mul(crossed(lanes, z, x), s),
            lanes.mul(crossed(lanes, x, y), s),
        ];
        let shift = linear(lanes, columns, [x_w, y_w, z_w]);
        [lanes.sub(linear(lanes, columns, origin), shift), linear(lanes, columns, direction)]
    }
}

/// Four lanes of `f64`, with the instructions of a traversal. Every operation rounds as IEEE 754 requires, so results are the same bits with any.
pub trait F64x4: Copy {
    /// Four numbers.
    type V: Copy;
    /// Numbers from memory.
    fn widen(self, x: &[f32; 4]) -> Self::V;
    /// `x` in every lane.
    fn splat(self, x: f64) -> Self::V;
    /// `a + b`.
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a - b`.
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a · b`.
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// Lanes 1, 2, 0 and 3.
    fn rotate(self, a: Self::V) -> Self::V;
    /// The lanes.
    fn store(self, a: Self::V) -> [f64; 4];
    /// The lanes, each rounded to nearest.
    fn narrow(self, a: Self::V) -> [f32; 4];
}

/// [`F64x4`] in plain Rust.
#[derive(Clone, Copy, Debug)]
pub struct Arrays;

impl F64x4 for Arrays {
    type V = [f64; 4];

    #[inline(always)]
    fn widen(self, &[x, y, z, w]: &[f32; 4]) -> [f64; 4] {
        [f64::from(x), f64::from(y), f64::from(z), f64::from(w)]
    }
    #[inline(always)]
    fn splat(self, x: f64) -> [f64; 4] {
        [x; 4]
    }
    #[inline(always)]
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
    }
    #[inline(always)]
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
    }
    #[inline(always)]
    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
    }
    #[inline(always)]
    fn rotate(self, [x, y, z, w]: [f64; 4]) -> [f64; 4] {
        [y, z, x, w]
    }
    #[inline(always)]
    fn store(self, a: [f64; 4]) -> [f64; 4] {
        a
    }
    #[inline(always)]
    fn narrow(self, [x, y, z, w]: [f64; 4]) -> [f32; 4] {
        [x as f32, y as f32, z as f32, w as f32]
    }
}

/// The cross product of two rows, each with its rotated one, as z, x, y.
#[inline(always)]
fn crossed<L: F64x4>(lanes: L, (p, p_rotated): (L::V, L::V), (q, q_rotated): (L::V, L::V)) -> L::V {
    lanes.sub(lanes.mul(p, q_rotated), lanes.mul(p_rotated, q))
}

#[inline(always)]
fn linear<L: F64x4>(lanes: L, [a, b, c]: [L::V; 3], [x, y, z]: [f32; 3]) -> L::V {
    let (x, y, z) = (lanes.splat(x.into()), lanes.splat(y.into()), lanes.splat(z.into()));
    lanes.add(lanes.add(lanes.mul(a, x), lanes.mul(b, y)), lanes.mul(c, z))
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
        let to_object = object_power(direction);
        let to_world = reciprocal_of_power(to_object);
        let [x, y, z] = origin;
        let origin = [x as f32, y as f32, z as f32];
        let direction = [(dx * to_world) as f32, (dy * to_world) as f32, (dz * to_world) as f32];
        self.rounded_in_object((origin, direction), to_object, t_max)
    }

    /// [`WorldRay::in_object`] of what was rounded, with the direction over the power of two.
    #[inline(always)]
    fn rounded_in_object(
        &self,
        (origin, direction): ([f32; 3], [f32; 3]),
        to_object: f64,
        t_max: f64,
    ) -> Option<ObjectRay> {
        let to_world = reciprocal_of_power(to_object);
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

/// The power of two of a direction in object space: that of its greatest component once rounded.
#[inline(always)]
fn object_power([x, y, z]: [f64; 3]) -> f64 {
    power_below_rounded(greatest([x.abs(), y.abs(), z.abs()]))
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
        self.object_by(Arrays)
    }

    /// [`PlacedRay::object`], computed by these lanes.
    #[inline(always)]
    #[must_use]
    pub fn object_by<L: F64x4>(&self, lanes: L) -> Option<ObjectRay> {
        let &ScaledRay { origin, direction, .. } = self.world.ray;
        let [origin, direction] = self.map.inverse_of(lanes, origin, direction);
        let [z, x, y, _] = lanes.store(direction);
        let to_object = object_power([x, y, z]);
        let direction = lanes.mul(direction, lanes.splat(reciprocal_of_power(to_object)));
        let ([oz, ox, oy, _], [dz, dx, dy, _]) = (lanes.narrow(origin), lanes.narrow(direction));
        self.world.rounded_in_object(([ox, oy, oz], [dx, dy, dz]), to_object, self.t_max)
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
