/// Half of `f32::EPSILON`: the relative error of one rounding to `f32`.
pub(crate) const U: f64 = 1.0 / 16_777_216.0;

/// Half of `f64::EPSILON`: the relative error of one rounding to `f64`.
pub(crate) const U64: f64 = f64::EPSILON / 2.0;

/// Least `f32` that is not below `x`.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "stepped upward where the cast rounded down")]
pub(crate) fn up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) < x { nearest.next_up() } else { nearest }
}

/// Greatest `f32` that is not above `x`.
#[inline]
pub(crate) fn down(x: f64) -> f32 {
    -up(-x)
}

/// The power of two at or below a positive normal `x`.
#[inline]
pub(crate) fn power_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000)
}

/// `1/x` of a normal power of two, exactly, by negating its exponent.
#[inline]
pub(crate) fn reciprocal_of_power(x: f64) -> f64 {
    f64::from_bits(0x7fe0_0000_0000_0000 - x.to_bits())
}
