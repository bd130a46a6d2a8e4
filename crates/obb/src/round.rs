//! Rounding outward, and powers of two: shared by the crates of the workspace. Not part of the stable interface.

/// Unit roundoff of `f64`, half the distance from one to the next number.
pub const U: f64 = f64::EPSILON / 2.0;

/// Least `f32` that is at least `x`.
///
/// Without a branch, which every second number would mispredict: as integers of the same order, the next float is the next number.
#[inline]
#[must_use]
pub fn up(x: f64) -> f32 {
    let nearest = x as f32;
    let ordered = |bits: i32| bits ^ (bits >> 31 & i32::MAX);
    let next = ordered(nearest.to_bits().cast_signed()) + i32::from(f64::from(nearest) < x);
    f32::from_bits(ordered(next).cast_unsigned())
}

/// Greatest `f32` that is at most `x`.
#[inline]
#[must_use]
pub fn down(x: f64) -> f32 {
    -up(-x)
}

/// The greatest of three numbers: one instruction each, where `max` takes four to ignore NaN. Of NaN any result.
#[inline]
#[must_use]
pub fn greatest<T: Copy + PartialOrd>([x, y, z]: [T; 3]) -> T {
    let xy = if x > y { x } else { y };
    if xy > z { xy } else { z }
}

/// The power of two at or below a positive normal `x`.
#[inline]
#[must_use]
pub fn power_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000)
}

/// `1/x` of a normal power of two, exactly, by negating its exponent: cheaper than a division.
#[inline]
#[must_use]
pub fn reciprocal_of_power(x: f64) -> f64 {
    f64::from_bits(0x7fe0_0000_0000_0000 - x.to_bits())
}

/// [`up`] for `x >= 0` without a branch: the next positive float has the next bit pattern.
#[inline(always)]
#[must_use]
pub fn magnitude_up(x: f64) -> f32 {
    let nearest = x as f32;
    f32::from_bits(nearest.to_bits() + u32::from(f64::from(nearest) < x))
}

/// [`down`] for `x >= 0` without a branch.
#[inline(always)]
#[must_use]
pub fn magnitude_down(x: f64) -> f32 {
    let nearest = x as f32;
    f32::from_bits(nearest.to_bits() - u32::from(f64::from(nearest) > x))
}

/// Least `f32` that is at least the exact `a - b`.
pub(crate) fn difference_up(a: f32, b: f32) -> f32 {
    let (a, b) = (f64::from(a), f64::from(b));
    let (difference, rest) = two_sum(a, -b);
    let bound = up(difference);
    // An exactly representable bound does not cover a positive rounding error of the sum.
    if rest > 0.0 && f64::from(bound) <= difference { bound.next_up() } else { bound }
}

/// `a + b` and its rounding error: the two results sum to `a + b` exactly (Knuth 1969).
#[inline]
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// The power of two that scales positive `x` to the interval `[1, 4)`; products with it are exact.
#[inline]
pub(crate) fn binade_inverse(x: f64) -> f64 {
    const BIASED_ONE: u64 = 1023;
    let biased = (x.to_bits() >> 52) & 0x7ff;
    // 2 · bias − e mirrors the exponent; at the ends of the range it is off by one, hence "4".
    f64::from_bits((2 * BIASED_ONE).saturating_sub(biased).clamp(1, 2 * BIASED_ONE) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_never_rounds_down() {
        for x in [
            0.0,
            1.0,
            1.0 + f64::EPSILON,
            0.1,
            1e-50,
            -1e-50,
            -1e-45,
            -2e-45,
            16_777_217.0,
            3.0e38,
            1e39,
            -1.0 - f64::EPSILON,
        ] {
            let bound = up(x);
            assert!(f64::from(bound) >= x && f64::from(bound.next_down()) < x, "{x}");
            assert_eq!(magnitude_up(x.abs()), up(x.abs()), "{x}");
            assert_eq!(magnitude_down(x.abs()), down(x.abs()), "{x}");
            let bound = down(x);
            assert!(f64::from(bound) <= x && f64::from(bound.next_up()) > x, "{x}");
        }
    }

    #[test]
    fn powers_of_two_are_exact() {
        for exponent in [-1022, -300, -1, 0, 1, 64, 1022] {
            let power = 2.0f64.powi(exponent);
            assert_eq!((power_below(1.75 * power), power_below(power)), (power, power), "{exponent}");
            assert_eq!(reciprocal_of_power(power) * power, 1.0, "{exponent}");
        }
    }

    #[test]
    fn differences_cover_what_f64_loses() {
        assert_eq!(difference_up(0.5, -1e-30), 0.5_f32.next_up());
        assert_eq!(difference_up(0.5, 1e-30), 0.5);
        assert_eq!(difference_up(3.0, 1.0), 2.0);
        assert_eq!(difference_up(1.0, 1.0), 0.0);
    }

    #[test]
    fn binade_inverse_covers_the_range_of_f64() {
        for x in [1.0, 1.5, 3.9, 1e-300, 1e300, f64::MAX, f64::MIN_POSITIVE] {
            let scaled = x * binade_inverse(x);
            assert!((1.0..4.0).contains(&scaled), "{x} -> {scaled}");
        }
    }
}
