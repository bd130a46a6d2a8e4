//! Colors as perceived at a viewing distance, and their difference.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::Plane;
use super::filter::Taps;

/// Linear RGB to CIE XYZ: the sRGB primaries under D65, exact from their chromaticities.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// Exponent that compresses color differences.
const COMPRESSION: f64 = 0.7;
/// Share of the maximum difference that is mapped to [`LINEAR_RESULT`] of the range.
const LINEAR_SHARE: f64 = 0.4;
/// The result for [`LINEAR_SHARE`].
const LINEAR_RESULT: f64 = 0.95;

/// `b` of the contrast sensitivity filters `a sqrt(π/b) exp(-π² x²/b)`, `x` in degrees: for lightness, for red-green, and two
/// whose sum is the filter for blue-yellow.
const WIDTHS: [f64; 4] = [0.0047, 0.0053, 0.04, 0.025];
/// The widest of [`WIDTHS`].
const WIDEST: f64 = 0.04;
/// `a` of the last two of [`WIDTHS`].
const BLUE_HEIGHTS: [f64; 2] = [34.1, 13.5];

fn matrix(rows: &[[f64; 3]; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    rows.map(|[a, b, c]| a * x + b * y + c * z)
}

/// CIE XYZ relative to white, from linear RGB.
fn relative_xyz(rgb: [f64; 3]) -> [f64; 3] {
    let (xyz, white) = (matrix(&XYZ_FROM_RGB, rgb), matrix(&XYZ_FROM_RGB, [1.0; 3]));
    std::array::from_fn(|k| xyz[k] / white[k])
}

/// Linear RGB from CIE XYZ relative to white.
fn rgb(relative: [f64; 3]) -> [f64; 3] {
    let white = matrix(&XYZ_FROM_RGB, [1.0; 3]);
    let xyz: [f64; 3] = std::array::from_fn(|k| relative[k] * white[k]);
    let [p, q, r] = XYZ_FROM_RGB;
    // Cramer's rule.
    let determinant = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - b[0] * (a[1] * c[2] - a[2] * c[1]) + c[0] * (a[1] * b[2] - a[2] * b[1])
    };
    let column = |k: usize| [p[k], q[k], r[k]];
    let all = determinant(column(0), column(1), column(2));
    [
        determinant(xyz, column(1), column(2)) / all,
        determinant(column(0), xyz, column(2)) / all,
        determinant(column(0), column(1), xyz) / all,
    ]
}

/// Linear opponent colors `Y Cx Cz` of linear RGB: lightness, red-green, blue-yellow.
pub(super) fn opponent(rgb: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = relative_xyz(rgb);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIELAB of opponent colors, clamped to the display gamut; `a` and `b` scale with lightness (Hunt).
fn to_lab([lightness, red, blue]: [f64; 3]) -> [f64; 3] {
    let y = (lightness + 16.0) / 116.0;
    let shown = rgb([red / 500.0 + y, y, y - blue / 200.0]).map(|x| x.clamp(0.0, 1.0));
    let [x, y, z] = relative_xyz(shown).map(|t| {
        const DELTA: f64 = 6.0 / 29.0;
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// Perceived colors at a number of pixels per degree.
pub(super) fn perceived(opponent: &Plane<3>, pixels_per_degree: f64) -> Plane<3> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of few pixels")]
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as usize;
    let taps = Taps::new(radius, |x| WIDTHS.map(|b| (-(PI * x / pixels_per_degree).powi(2) / b).exp()));
    // The sum of a Gaussian in two dimensions is the square of its sum in one.
    let sums = taps.sums();
    let blue: [f64; 2] = std::array::from_fn(|i| BLUE_HEIGHTS[i] * (PI / WIDTHS[2 + i]).sqrt() * sums[2 + i].powi(2));
    let [wide, narrow] = blue.map(|part| part / (blue[0] + blue[1]));
    let taps = taps.normalized();
    let filtered = taps.along_columns(&taps.along_rows(&opponent.map(|[y, red, blue]| [y, red, blue, blue])));
    filtered.map(|[y, red, blue_wide, blue_narrow]| to_lab([y, red, wide * blue_wide + narrow * blue_narrow]))
}

/// Compressed HyAB distance of two colors.
fn distance([l, a, b]: [f64; 3], [m, c, d]: [f64; 3]) -> f64 {
    ((l - m).abs() + (a - c).hypot(b - d)).powf(COMPRESSION)
}

/// The maximum distance in the display gamut: from green to blue.
static GREATEST: LazyLock<f64> = LazyLock::new(|| {
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| to_lab(opponent(rgb)));
    distance(green, blue)
});

/// Difference of two perceived colors, 0 to 1.
pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> f64 {
    let share = distance(a, b) / *GREATEST;
    if share < LINEAR_SHARE {
        LINEAR_RESULT / LINEAR_SHARE * share
    } else {
        LINEAR_RESULT + (share - LINEAR_SHARE) / (1.0 - LINEAR_SHARE) * (1.0 - LINEAR_RESULT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opponent_colors_are_invertible() {
        for color in [[0.2, 0.5, 0.9], [1.0, 0.0, 0.25]] {
            let [y, red, blue] = opponent(color);
            let lightness = (y + 16.0) / 116.0;
            let back = rgb([red / 500.0 + lightness, lightness, lightness - blue / 200.0]);
            assert!(back.iter().zip(color).all(|(a, b)| (a - b).abs() < 1e-14), "{back:?}");
        }
    }

    #[test]
    fn white_and_black_differ_by_a_hundred() {
        let [white, black] = [[1.0; 3], [0.0; 3]].map(|rgb| to_lab(opponent(rgb)));
        assert!((white[0] - 100.0).abs() < 1e-12 && black[0].abs() < 1e-12, "{white:?} {black:?}");
        assert!(white[1].abs() + white[2].abs() < 1e-12, "white has no chroma");
    }

    #[test]
    fn green_and_blue_have_the_maximum_difference() {
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| to_lab(opponent(rgb)));
        assert!((difference(green, blue) - 1.0).abs() < 1e-15);
        assert_eq!(difference(green, green), 0.0);
    }
}
