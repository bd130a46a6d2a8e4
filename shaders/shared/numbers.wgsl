// Constants, and arithmetic that never produces infinity or NaN.

const PI: f32 = 3.14159265;
const TAU: f32 = 6.28318531;

/// Upper bound of quotients: two of them and a color can be multiplied without overflow.
const MAX_QUOTIENT: f32 = 1e18;

/// Upper bound of radiance: even 1e8 times as much is finite.
const MAX_RADIANCE: f32 = 1e28;

/// Smaller squared lengths may have been flushed to zero; vectors that short have no direction.
const MIN_SQUARE: f32 = 1e-36;

/// `a / b` of nonnegative numbers, at most `MAX_QUOTIENT`.
fn quotient(a: f32, b: f32) -> f32 {
    // Larger divisors are not flushed to zero.
    let divisor = max(b, 1e-37);
    return min(a, MAX_QUOTIENT * min(divisor, 1.0)) / divisor;
}

/// A nonnegative color, clamped so that products do not overflow.
fn bounded(color: vec3<f32>) -> vec3<f32> {
    return min(color, vec3(MAX_RADIANCE));
}

/// 1 or -1, by the sign bit: -0 is negative.
fn sign_of(x: f32) -> f32 {
    return select(1.0, -1.0, (bitcast<u32>(x) >> 31u) != 0u);
}
