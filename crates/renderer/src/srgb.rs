//! The sRGB curve (IEC 61966-2-1), both ways. Linear inside, sRGB at both ends.

use std::sync::LazyLock;

/// Linear value of each byte.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        #[expect(clippy::cast_possible_truncation, reason = "an index below 256; rounding to f32 is the result")]
        let linear = to_linear(f64::from(byte as u8) / 255.0) as f32;
        linear
    })
});

/// Linear value of an sRGB byte.
pub(crate) fn decode(byte: u8) -> f32 {
    LINEAR[usize::from(byte)]
}

/// Linear value of an sRGB value in 0..=1.
pub(crate) fn to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The byte next to the sRGB value of a linear one, clamped to 0..=1 first; a NaN is black.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=255; NaN casts to 0")]
pub(crate) fn encode(linear: f32) -> u8 {
    let x = f64::from(linear).clamp(0.0, 1.0);
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // Byte 128 is linear 0.2158605; middle grey 0.18 is byte 118; both from the standard's formula by hand.
        for (linear, byte) in [(0.0, 0), (1.0, 255), (0.18, 118), (0.5, 188), (0.215_860_5, 128), (0.003_130_8, 10)] {
            assert_eq!(encode(linear), byte, "{linear}");
        }
        assert!((decode(128) - 0.215_860_5).abs() < 1e-7);
        assert_eq!(decode(0), 0.0);
        assert_eq!(decode(255), 1.0);
    }

    #[test]
    fn every_byte_survives_the_round_trip() {
        for byte in 0..=255 {
            assert_eq!(encode(decode(byte)), byte);
        }
    }

    #[test]
    fn out_of_range_is_clamped() {
        for (linear, byte) in
            [(-1.0, 0), (-0.0, 0), (2.0, 255), (f32::INFINITY, 255), (f32::NEG_INFINITY, 0), (f32::NAN, 0)]
        {
            assert_eq!(encode(linear), byte, "{linear}");
        }
    }
}
