// Constants, and arithmetic that makes neither infinity nor what is no number.

const PI: f32 = 3.14159265;
const TAU: f32 = 6.28318531;

/// No quotient is greater: two of them, and a colour, can be multiplied without overflow.
const GREATEST: f32 = 1e18;

/// No radiance is greater; a hundred million times as much still is a number.
const BRIGHTEST: f32 = 1e28;

/// Squares of lengths below it may have been flushed to zero: what is so near has no direction.
const LEAST_SQUARE: f32 = 1e-36;

/// `a / b` of numbers that are not negative, at most `GREATEST`.
fn quotient(a: f32, b: f32) -> f32 {
    // Divisors from here on are not flushed to zero.
    let divisor = max(b, 1e-37);
    return min(a, GREATEST * min(divisor, 1.0)) / divisor;
}

/// A colour that is not negative, cut where products could overflow.
fn bounded(color: vec3<f32>) -> vec3<f32> {
    return min(color, vec3(BRIGHTEST));
}

/// 1 or -1, by the bit: -0 is negative.
fn sign_of(x: f32) -> f32 {
    return select(1.0, -1.0, (bitcast<u32>(x) >> 31u) != 0u);
}
