//! The sRGB transfer function (IEC 61966-2-1) and luminance.

use std::sync::LazyLock;

/// Linear value of each byte.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| to_linear(f64::from(byte as u8) / 255.0) as f32));

/// Linear value of an sRGB byte.
#[must_use]
pub fn decode(byte: u8) -> f32 {
    LINEAR[usize::from(byte)]
}

/// Linear value of each sRGB byte.
#[must_use]
pub fn linear() -> &'static [f32; 256] {
    &LINEAR
}

/// Linear value of an sRGB value in 0..=1.
#[must_use]
pub fn to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Relative luminance of linear RGB (ITU-R BT.709).
#[must_use]
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The nearest 16-bit sRGB value of a linear value clamped to 0..=1; NaN gives 0.
#[must_use]
pub fn encode_16(linear: f32) -> u16 {
    (from_linear_unit(f64::from(linear).clamp(0.0, 1.0)) * 65535.0).round() as u16
}

/// The sRGB value in 0..=1 of a linear value in 0..=1.
fn from_linear_unit(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Steps of the table: the slope of the curve is at most 12.92, so a step has at most one value halfway between bytes.
const STEPS: usize = 4096;

/// The smallest byte in each step of linear values, and the linear value halfway from each byte to the next.
static BYTES: LazyLock<(Vec<u8>, [f64; 256])> = LazyLock::new(|| {
    let first = (0..=STEPS).map(|step| from_linear(step as f64 / STEPS as f64)).collect();
    let halfway =
        std::array::from_fn(|byte| if byte < 255 { to_linear((byte as f64 + 0.5) / 255.0) } else { f64::MAX });
    (first, halfway)
});

/// The nearest sRGB byte of a linear value clamped to 0..=1; NaN gives 0.
#[must_use]
pub fn encode(linear: f32) -> u8 {
    let x = f64::from(linear).clamp(0.0, 1.0);
    let (first, halfway) = &*BYTES;
    let byte = first[(x * STEPS as f64) as usize];
    byte + u8::from(x >= halfway[usize::from(byte)])
}

/// [`encode`] by the formula.
fn from_linear(x: f64) -> u8 {
    (255.0 * from_linear_unit(x)).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the last digit computed by hand, plus the rounding of numbers below a quarter.
    const BY_HAND: f32 = 0.5e-7 + 0.125 * f32::EPSILON;

    #[test]
    fn known_values() {
        // Byte 128 is linear 0.2158605; middle gray 0.18 is byte 118; both from the standard's formula by hand.
        for (linear, byte) in [(0.0, 0), (1.0, 255), (0.18, 118), (0.5, 188), (0.215_860_5, 128), (0.003_130_8, 10)] {
            assert_eq!(encode(linear), byte, "{linear}");
        }
        for (linear, byte) in [(-1.0, 0), (2.0, 255), (f32::INFINITY, 255), (f32::NEG_INFINITY, 0), (f32::NAN, 0)] {
            assert_eq!(encode(linear), byte, "{linear} is clamped");
        }
        assert!((decode(128) - 0.215_860_5).abs() <= BY_HAND);
        assert_eq!(decode(0), 0.0);
        assert_eq!(decode(255), 1.0);
    }

    #[test]
    fn bytes_survive_the_round_trip() {
        for byte in 0..=255 {
            assert_eq!(encode(decode(byte)), byte);
        }
    }

    #[test]
    fn the_table_agrees_with_the_formula() {
        let halfway = (0..255_u8).map(|byte| to_linear((f64::from(byte) + 0.5) / 255.0));
        let bits = halfway.map(|x| (x as f32).to_bits()).flat_map(|bits| bits - 2..=bits + 2);
        for bits in bits.chain((0..1.0_f32.to_bits()).step_by(10_007)) {
            let x = f32::from_bits(bits);
            assert_eq!(encode(x), from_linear(f64::from(x)), "{x:e}");
        }
    }
}
