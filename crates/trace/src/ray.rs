use canted_obb::round::{greatest, magnitude_down, magnitude_up, power_below, reciprocal_of_power};

/// A ray `origin + t · direction` over the closed interval `t_min <= t <= t_max`.
///
/// The direction may have any length except zero. It is never normalized, so `t` is the same number in every space, in
/// units of the direction. A ray with a NaN component, an infinite origin or direction, a zero
/// direction, a negative `t_min` or an empty interval never hits.
///
/// `t_min` may be 0 and subnormal; a hit at exactly `t_min` or `t_max` counts, by its `t` before it is rounded to `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin.
    pub origin: [f32; 3],
    /// Direction.
    pub direction: [f32; 3],
    /// Minimum `t`, at least 0: a ray with a negative one never hits.
    pub t_min: f32,
    /// Maximum `t`; may be infinite. No hit has a `t` that is not finite.
    pub t_max: f32,
    /// The time of what moves: 0 as the shutter opens, 1 as it closes; clamped to `[0, 1]`. 0 by default.
    pub time: f32,
    /// Instances are tested whose own mask shares a bit with this one. All bits by default; without any bit, nothing is hit.
    pub mask: u32,
}

impl Ray {
    /// An infinite ray from `origin`, at time 0, that sees every instance.
    ///
    /// To continue from a hit use [`crate::SurfacePoint::spawn_ray`]: a ray from `ray.at(t)` often hits the same surface
    /// again.
    #[must_use]
    pub fn new(origin: impl Into<[f32; 3]>, direction: impl Into<[f32; 3]>) -> Self {
        Self { origin: origin.into(), direction: direction.into(), ..Self::DEFAULT }
    }

    const DEFAULT: Self =
        Self { origin: [0.0; 3], direction: [0.0; 3], t_min: 0.0, t_max: f32::INFINITY, time: 0.0, mask: u32::MAX };

    /// The same ray over `t_min <= t <= t_max`.
    #[must_use]
    pub fn between(self, t_min: f32, t_max: f32) -> Self {
        Self { t_min, t_max, ..self }
    }

    /// The same ray at another time.
    #[must_use]
    pub fn at_time(self, time: f32) -> Self {
        Self { time, ..self }
    }

    /// The same ray with another mask.
    #[must_use]
    pub fn with_mask(self, mask: u32) -> Self {
        Self { mask, ..self }
    }

    /// The point at `t`, computed in `f64`.
    #[must_use]
    pub fn at(&self, t: f64) -> [f64; 3] {
        core::array::from_fn(|k| f64::from(self.origin[k]) + t * f64::from(self.direction[k]))
    }
}

/// A ray whose direction is scaled by a power of two, so that its greatest component lies in `[1, 2)`.
///
/// Every test takes a scaled ray: reciprocals cannot overflow, and scaling a direction by a power of two changes no bit of
/// a result. The scaled `t` is the `t` of the original ray times that power of two.
///
/// # Over- and underflow of `t`
/// Hits are compared, and tested against the interval, by their scaled `t`, which is an `f32`. The ends of the interval are
/// rounded inward, so that a scaled `t` lies between them if and only if the original ray's `t` lies in its interval, in real
/// arithmetic. An infinite interval ends at the greatest finite `t`: what a very short direction would reach only beyond it is not hit. A `t`
/// below the smallest normal number is rounded to a subnormal or zero when the hit is reported: hits in order may then have equal `t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaledRay {
    /// Origin.
    pub origin: [f32; 3],
    /// Direction with greatest absolute component in `[1, 2)`.
    pub direction: [f32; 3],
    /// Minimum scaled `t`.
    pub t_min: f32,
    /// Maximum scaled `t`.
    pub t_max: f32,
    /// Time of the ray, as given.
    pub time: f32,
    /// Mask of the ray.
    pub mask: u32,
    /// The bits of both ends of the caller's interval, the second above. As one number, since two that are written one by one and read together stall
    /// the load.
    interval: u64,
    /// Scaled `t` over `t`: an exact power of two.
    to_scaled: f64,
}

/// The least power of two whose reciprocal is no normal `f32`, 2^127.
const BEYOND: f32 = f32::from_bits(254 << 23);

impl ScaledRay {
    /// Scales `ray`. `None` for a ray that cannot hit: a zero direction, a component that is not finite, or an empty
    /// interval.
    #[inline(always)]
    #[must_use]
    pub fn new(ray: &Ray) -> Option<Self> {
        // Component by component: `map` and `all` may be calls that pass arrays in memory.
        let ([dx, dy, dz], [ox, oy, oz]) = (ray.direction, ray.origin);
        let [x, y, z] = [dx.abs(), dy.abs(), dz.abs()];
        let greatest = greatest([x, y, z]);
        let finite = (x + y + z).is_finite() || (x.is_finite() && y.is_finite() && z.is_finite());
        let origin_finite = ox.is_finite() & oy.is_finite() & oz.is_finite();
        // Negated to reject a NaN in the interval too.
        let has_interval = ray.t_min >= 0.0 && ray.t_min <= ray.t_max && ray.t_min <= f32::MAX;
        if !(greatest > 0.0 && finite && origin_finite && has_interval && ray.mask != 0) {
            return None;
        }
        let &Ray { origin, direction, t_min, time, mask, .. } = ray;
        let interval @ [_, end] = [t_min, ray.t_max.min(f32::MAX)];
        let to_scaled = power_below(greatest.into());
        let (power, from_scaled) = (to_scaled as f32, reciprocal_of_power(to_scaled) as f32);
        let (start, stop) = (t_min * power, end * power);
        // Most rays: `f32` scales their interval without rounding, and a direction with the only rounding that `f64` has.
        let is_exact = (f32::MIN_POSITIVE..BEYOND).contains(&greatest)
            & ((t_min == 0.0) | (f32::MIN_POSITIVE <= start))
            & (start <= f32::MAX)
            // Not equal, since a product below may have been rounded up to it.
            & (f32::MIN_POSITIVE < stop);
        // Numbers, not a ray in memory: what is written in parts is read as a whole only once it has arrived.
        let (direction, t_min, t_max) = if is_exact {
            ([dx * from_scaled, dy * from_scaled, dz * from_scaled], start, stop.min(f32::MAX))
        } else {
            by_f64(direction, interval, to_scaled)
        };
        // No f32 lies between both ends where they underflow.
        let scaled = Ray { origin, direction, t_min, t_max, time, mask };
        (t_min <= t_max).then_some(Self::from_parts(&scaled, interval, to_scaled))
    }

    /// Scaled `t` over `t` of the original ray: a power of two from 2^-149 to 2^127.
    #[inline]
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.to_scaled
    }

    /// A ray from what [`ScaledRay::new`] computes: a scaled ray, the interval before it was scaled, and the power of two.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn from_parts(scaled: &Ray, [start, end]: [f32; 2], to_scaled: f64) -> Self {
        let &Ray { origin, direction, t_min, t_max, time, mask } = scaled;
        let interval = u64::from(start.to_bits()) | u64::from(end.to_bits()) << 32;
        Self { origin, direction, t_min, t_max, time, mask, interval, to_scaled }
    }

    /// Both ends of the caller's interval, scaled, without rounding.
    #[inline(always)]
    #[must_use]
    pub fn exact_interval(&self) -> [f64; 2] {
        // Not by `map`, which may be a call that writes both to memory.
        let (start, end) = (f32::from_bits(self.interval as u32), f32::from_bits((self.interval >> 32) as u32));
        [f64::from(start) * self.to_scaled, f64::from(end) * self.to_scaled]
    }

    /// The scaled `t` of a `t` of the original ray.
    #[inline]
    #[must_use]
    pub fn scaled_t(&self, t: f32) -> f32 {
        (f64::from(t) * self.to_scaled) as f32
    }

    /// The `t` of the original ray of a scaled `t`; subnormal or zero where it leaves the range of normal numbers.
    #[inline]
    #[must_use]
    pub fn caller_t(&self, scaled_t: f32) -> f32 {
        (f64::from(scaled_t) * reciprocal_of_power(self.to_scaled)) as f32
    }
}

/// A direction over a power of two, and an interval times it, its ends rounded inward.
#[cold]
fn by_f64([dx, dy, dz]: [f32; 3], [t_min, t_max]: [f32; 2], power: f64) -> ([f32; 3], f32, f32) {
    let from_scaled = reciprocal_of_power(power);
    let scaled = |d: f32| (f64::from(d) * from_scaled) as f32;
    let (t_min, t_max) = (magnitude_up(f64::from(t_min) * power), magnitude_down(f64::from(t_max) * power));
    ([scaled(dx), scaled(dy), scaled(dz)], t_min, t_max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(ray: &ScaledRay) -> [u32; 5] {
        let [x, y, z] = ray.direction;
        [x, y, z, ray.t_min, ray.t_max].map(f32::to_bits)
    }

    /// Of directions and intervals around the ends of the range in which `f32` scales.
    #[test]
    fn rays_are_scaled_alike_by_f32_and_by_f64() {
        let (mut n_rays, mut n_rounded) = (0, 0);
        // Scaled by a half or a quarter, the ends after that below the normal numbers are rounded to the least of these.
        let [half, quarter] = [2.0, 4.0].map(|scale| (scale * f32::MIN_POSITIVE).next_down());
        let ends = [0.0, 1e-45, 3e-39, f32::MIN_POSITIVE, half, quarter, 1e-30, 0.3, 7.0, 1e30, f32::MAX];
        for exponent in (-149..=127).step_by(3).chain([-1, -2]) {
            let size = 2_f64.powi(exponent) as f32 * 1.37;
            let direction = [size, -size * 0.7e-38, size * 0.3];
            for (i, &t_min) in ends.iter().enumerate() {
                for &t_max in ends[i..].iter().chain([&f32::INFINITY]) {
                    let ray = Ray::new([0.0; 3], direction).between(t_min, t_max);
                    let interval = [t_min, t_max.min(f32::MAX)];
                    let to_scaled = power_below(size.into());
                    let ([x, y, z], start, end) = by_f64(direction, interval, to_scaled);
                    let expected = (start <= end).then(|| [x, y, z, start, end].map(f32::to_bits));
                    assert_eq!(ScaledRay::new(&ray).as_ref().map(bits), expected, "{ray:?}");
                    n_rays += usize::from(expected.is_some());
                    n_rounded += usize::from(expected.is_some() && f64::from(start) != f64::from(t_min) * to_scaled);
                }
            }
        }
        assert!(n_rays > 1000 && n_rounded > 100, "{n_rays} rays, {n_rounded} with a rounded end");
    }
}
