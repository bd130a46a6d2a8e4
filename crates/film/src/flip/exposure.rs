//! Exposures for pictures of high dynamic range, and tone mapping.

use crate::srgb::luminance;

/// `[a, b]` of the filmic curve `(a x² + b x) / (c x² + d x + e)`: Narkowicz's fit of ACES, with its input scaled by 0.6.
const ABOVE: [f64; 2] = [0.36 * 2.51, 0.6 * 0.03];
/// `[c, d, e]` of the curve.
const BELOW: [f64; 3] = [0.36 * 2.43, 0.6 * 0.59, 0.14];
/// The tone-mapped value of the brightest luminance at the first exposure, and of the median at the last.
const SHOWN: f64 = 0.85;
/// The minimum luminance that determines an exposure.
const DARKEST: f64 = 1e-5;

/// Exposures, as exponents of two, from the one that maps the brightest luminance to [`SHOWN`] to the one that maps the median
/// to it: one per power of two, and at least two.
pub(super) fn exposures(reference: &[[f64; 3]]) -> Vec<f64> {
    let mut luminances: Vec<f64> = reference.iter().map(|&pixel| luminance(pixel)).collect();
    luminances.sort_by(f64::total_cmp);
    let n = luminances.len();
    let median = 0.5 * (luminances[(n - 1) / 2] + luminances[n / 2]);
    let [start, stop] = [luminances[n - 1], median].map(|luminance| (source(SHOWN) / luminance.max(DARKEST)).log2());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "f64 holds few powers of two")]
    let n_exposures = ((stop - start).ceil() as u32).max(2);
    let step = (stop - start) / f64::from(n_exposures - 1);
    (0..n_exposures).map(|i| start + step * f64::from(i)).collect()
}

/// Tone-mapped linear RGB at an exposure.
pub(super) fn tone_mapped(rgb: [f64; 3], exposure: f64) -> [f64; 3] {
    let gain = exposure.exp2();
    rgb.map(|x| {
        // Above this limit the curve is constant; it keeps squares finite.
        let x = (x * gain).min(1e30);
        (x * (ABOVE[0] * x + ABOVE[1]) / (x * (BELOW[0] * x + BELOW[1]) + BELOW[2])).clamp(0.0, 1.0)
    })
}

/// The input that the curve maps to `shown`.
fn source(shown: f64) -> f64 {
    let [a, b] = [ABOVE[0] - shown * BELOW[0], ABOVE[1] - shown * BELOW[1]];
    let c = -shown * BELOW[2];
    let half = -0.5 * b / a;
    half + (half * half - c / a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_inverted() {
        let [shown, ..] = tone_mapped([source(SHOWN) / 8.0; 3], 3.0);
        assert!((shown - SHOWN).abs() < 1e-12, "{shown}");
        assert_eq!(tone_mapped([0.0, 1e38, 1e300], 0.0), [0.0, 1.0, 1.0]);
    }

    #[test]
    fn exposures_go_from_the_brightest_to_the_median() {
        let exposures = exposures(&[[1.0; 3], [1.0; 3], [32.0; 3]]);
        assert_eq!(exposures.len(), 5);
        assert!((exposures[4] - exposures[0] - 5.0).abs() < 1e-12, "{exposures:?}");
    }

    #[test]
    fn a_black_reference_has_exposures() {
        assert!(exposures(&[[0.0; 3]; 4]).iter().all(|x| x.is_finite()));
    }
}
