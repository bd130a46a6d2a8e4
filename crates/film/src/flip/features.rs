//! Edges and points of a picture, and their difference.

use super::Plane;
use super::filter::Taps;

/// Width of the feature filters in degrees.
const WIDTH: f64 = 0.082;
/// Exponent that compresses feature differences.
const COMPRESSION: f64 = 0.5;

/// First derivatives of luma along rows and columns, then second derivatives.
pub(super) fn features(opponent: &Plane<3>, pixels_per_degree: f64) -> Plane<4> {
    let sigma = 0.5 * WIDTH * pixels_per_degree;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of few pixels")]
    let radius = (3.0 * sigma).ceil() as usize;
    let smooth = move |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let first = move |x: f64| -x * smooth(x);
    let second = move |x: f64| (x * x / (sigma * sigma) - 1.0) * smooth(x);
    let rows = Taps::new(radius, |x| [first(x), smooth(x), second(x), smooth(x)]).normalized();
    let columns = Taps::new(radius, |x| [smooth(x), first(x), smooth(x), second(x)]).normalized();
    columns.along_columns(&rows.along_rows(&opponent.map(|[y, ..]| [(y + 16.0) / 116.0; 4])))
}

/// Difference of the features of two pixels, 0 to 1: the greater of edge and point difference.
pub(super) fn difference(a: [f64; 4], b: [f64; 4]) -> f64 {
    let strengths = |[x, y, xx, yy]: [f64; 4]| [x.hypot(y), xx.hypot(yy)];
    let ([edge_a, point_a], [edge_b, point_b]) = (strengths(a), strengths(b));
    let greatest = (edge_a - edge_b).abs().max((point_a - point_b).abs());
    (std::f64::consts::FRAC_1_SQRT_2 * greatest).powf(COMPRESSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_an_edge_of_the_same_height() {
        // Luma 0 to the left and 1 to the right: next to the step, only the positive half of the filter covers 1.
        let values = (0..64).map(|x| if x % 32 < 16 { [-16.0, 0.0, 0.0] } else { [100.0, 0.0, 0.0] }).collect();
        let plane = features(&Plane { width: 32, values }, 20.0);
        let [x, y, ..] = plane.values[16];
        assert!((x.abs() - 1.0).abs() < 1e-12 && y.abs() < 1e-12, "{x} {y}");
        assert!(plane.values[0].iter().all(|x| x.abs() < 1e-12), "no feature far from the step");
    }
}
