//! FLIP: the difference that a viewer perceives when alternating between two pictures, from 0 to 1 per pixel.
//!
//! ```text
//! linear RGB -> opponent colors -> contrast sensitivity filters -> color difference \
//!            -> luma -> edges, points                           -> feature difference -> error
//! ```
//!
//! Andersson et al., FLIP: A Difference Evaluator for Alternating Images, HPG 2020; Andersson et al., Visualizing Errors
//! in Rendered High Dynamic Range Images, Eurographics Short Papers 2021. All constants are theirs.

use std::f64::consts::PI;
use std::sync::LazyLock;

use rayon::prelude::*;

use crate::compare::{self, CompareError};
use crate::srgb::luminance;
use crate::{Picture, heatmap};

/// Pixels per degree of visual angle in the papers: 3840 pixels over 0.7 m, perceived from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;

/// The error of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    width: u32,
    height: u32,
    /// `None` where a picture is not finite.
    errors: Vec<Option<f64>>,
}

impl Flip {
    /// The error of each pixel in 0..=1, row by row; `None` where it is not finite in one of the pictures.
    #[must_use]
    pub fn errors(&self) -> &[Option<f64>] {
        &self.errors
    }

    /// Mean over the pixels that are finite in both pictures.
    #[must_use]
    pub fn mean(&self) -> f64 {
        let finite = self.errors.iter().flatten();
        let n = finite.clone().count() as f64;
        finite.sum::<f64>() / n
    }

    /// The errors in false color, from dark to yellow; magenta where there is no error.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let color = |error: &Option<f64>| error.map_or([1.0, 0.0, 1.0], heatmap::viridis);
        Picture { width: self.width, height: self.height, pixels: self.errors.iter().map(color).collect() }
    }
}

/// Compares two linear pictures, clamped to 0..=1.
///
/// Pixels that are not finite in both count as black and have no error.
///
/// # Errors
/// Those of [`crate::compare()`].
pub fn flip(picture: &Picture, reference: &Picture, pixels_per_degree: f64) -> Result<Flip, CompareError> {
    let pair = Pair::new(picture, reference)?;
    let errors = errors(&pair.planes(|x| x.clamp(0.0, 1.0)), pixels_per_degree);
    Ok(pair.flip(errors))
}

/// Compares two linear pictures of high dynamic range; the error of a pixel is the maximum over exposures from the brightest
/// luminance of the reference to its median.
///
/// # Errors
/// Those of [`crate::compare()`].
pub fn flip_hdr(picture: &Picture, reference: &Picture, pixels_per_degree: f64) -> Result<Flip, CompareError> {
    let pair = Pair::new(picture, reference)?;
    let planes = pair.planes(|x| x.max(0.0));
    let mut greatest = vec![0.0_f64; pair.is_finite.len()];
    for exposure in exposures(&planes[1].values) {
        let shown = planes.clone().map(|plane| plane.map(|pixel| tone_mapped(pixel, exposure)));
        for (greatest, error) in greatest.iter_mut().zip(errors(&shown, pixels_per_degree)) {
            *greatest = greatest.max(error);
        }
    }
    Ok(pair.flip(greatest))
}

/// Two pictures of one size.
struct Pair<'a> {
    pictures: [&'a Picture; 2],
    is_finite: Vec<bool>,
}

impl<'a> Pair<'a> {
    fn new(picture: &'a Picture, reference: &'a Picture) -> Result<Self, CompareError> {
        compare::check_sizes(picture, reference)?;
        let is_finite: Vec<bool> =
            picture.pixels.iter().zip(&reference.pixels).map(|(a, b)| compare::are_finite(a, b)).collect();
        if is_finite.contains(&true) {
            Ok(Self { pictures: [picture, reference], is_finite })
        } else {
            Err(CompareError::NothingFinite)
        }
    }

    /// Both pictures in `f64`, with `range` applied to each channel.
    fn planes(&self, range: impl Fn(f64) -> f64 + Copy) -> [Plane<3>; 2] {
        self.pictures.map(|picture| {
            let pixel = |(pixel, &is_finite): (&[f32; 3], &bool)| {
                if is_finite { pixel.map(|x| range(f64::from(x))) } else { [0.0; 3] }
            };
            Plane {
                width: picture.width as usize,
                values: picture.pixels.iter().zip(&self.is_finite).map(pixel).collect(),
            }
        })
    }

    fn flip(&self, errors: Vec<f64>) -> Flip {
        let Picture { width, height, .. } = *self.pictures[0];
        let errors = errors.into_iter().zip(&self.is_finite).map(|(error, &is_finite)| is_finite.then_some(error));
        Flip { width, height, errors: errors.collect() }
    }
}

/// `N` numbers per pixel, row by row.
#[derive(Clone)]
struct Plane<const N: usize> {
    width: usize,
    values: Vec<[f64; N]>,
}

impl<const N: usize> Plane<N> {
    fn map<const M: usize>(&self, each: impl Fn([f64; N]) -> [f64; M] + Sync + Send) -> Plane<M> {
        Plane { width: self.width, values: self.values.par_iter().map(|&value| each(value)).collect() }
    }
}

/// The errors of two planes of linear RGB in 0..=1.
fn errors(planes: &[Plane<3>; 2], pixels_per_degree: f64) -> Vec<f64> {
    let opponent = planes.each_ref().map(|plane| plane.map(opponent));
    let perceived = opponent.each_ref().map(|plane| perceived(plane, pixels_per_degree));
    let features = opponent.each_ref().map(|plane| features(plane, pixels_per_degree));
    let n = planes[0].values.len();
    (0..n)
        .into_par_iter()
        .map(|i| {
            let color = color_difference(perceived[0].values[i], perceived[1].values[i]);
            let feature = feature_difference(features[0].values[i], features[1].values[i]);
            color.powf(1.0 - feature)
        })
        .collect()
}

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
fn exposures(reference: &[[f64; 3]]) -> Vec<f64> {
    let mut luminances: Vec<f64> = reference.iter().map(|&pixel| luminance(pixel)).collect();
    luminances.sort_by(f64::total_cmp);
    let n = luminances.len();
    let median = 0.5 * (luminances[(n - 1) / 2] + luminances[n / 2]);
    let [start, stop] =
        [luminances[n - 1], median].map(|luminance| (inverse_curve(SHOWN) / luminance.max(DARKEST)).log2());
    let n_exposures = ((stop - start).ceil() as u32).max(2);
    let step = (stop - start) / f64::from(n_exposures - 1);
    (0..n_exposures).map(|i| start + step * f64::from(i)).collect()
}

/// Tone-mapped linear RGB at an exposure.
fn tone_mapped(rgb: [f64; 3], exposure: f64) -> [f64; 3] {
    let gain = exposure.exp2();
    rgb.map(|x| {
        // Above this limit the curve is constant; it keeps squares finite.
        let x = (x * gain).min(1e30);
        (x * (ABOVE[0] * x + ABOVE[1]) / (x * (BELOW[0] * x + BELOW[1]) + BELOW[2])).clamp(0.0, 1.0)
    })
}

/// The input that the curve maps to `shown`.
fn inverse_curve(shown: f64) -> f64 {
    let [a, b] = [ABOVE[0] - shown * BELOW[0], ABOVE[1] - shown * BELOW[1]];
    let c = -shown * BELOW[2];
    let half = -0.5 * b / a;
    half + (half * half - c / a).sqrt()
}

/// Linear RGB to CIE XYZ: the sRGB primaries under D65, exact from their chromaticities.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// Exponent that compresses color differences.
const COLOR_COMPRESSION: f64 = 0.7;
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
fn opponent(rgb: [f64; 3]) -> [f64; 3] {
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
fn perceived(opponent: &Plane<3>, pixels_per_degree: f64) -> Plane<3> {
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
    ((l - m).abs() + (a - c).hypot(b - d)).powf(COLOR_COMPRESSION)
}

/// The maximum distance in the display gamut: from green to blue.
static GREATEST: LazyLock<f64> = LazyLock::new(|| {
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| to_lab(opponent(rgb)));
    distance(green, blue)
});

/// Difference of two perceived colors, 0 to 1.
fn color_difference(a: [f64; 3], b: [f64; 3]) -> f64 {
    let share = distance(a, b) / *GREATEST;
    if share < LINEAR_SHARE {
        LINEAR_RESULT / LINEAR_SHARE * share
    } else {
        LINEAR_RESULT + (share - LINEAR_SHARE) / (1.0 - LINEAR_SHARE) * (1.0 - LINEAR_RESULT)
    }
}

/// Width of the feature filters in degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent that compresses feature differences.
const FEATURE_COMPRESSION: f64 = 0.5;

/// First derivatives of luma along rows and columns, then second derivatives.
fn features(opponent: &Plane<3>, pixels_per_degree: f64) -> Plane<4> {
    let sigma = 0.5 * FEATURE_WIDTH * pixels_per_degree;
    let radius = (3.0 * sigma).ceil() as usize;
    let smooth = move |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let first = move |x: f64| -x * smooth(x);
    let second = move |x: f64| (x * x / (sigma * sigma) - 1.0) * smooth(x);
    let rows = Taps::new(radius, |x| [first(x), smooth(x), second(x), smooth(x)]).normalized();
    let columns = Taps::new(radius, |x| [smooth(x), first(x), smooth(x), second(x)]).normalized();
    columns.along_columns(&rows.along_rows(&opponent.map(|[y, ..]| [(y + 16.0) / 116.0; 4])))
}

/// Difference of the features of two pixels, 0 to 1: the greater of edge and point difference.
fn feature_difference(a: [f64; 4], b: [f64; 4]) -> f64 {
    let strengths = |[x, y, xx, yy]: [f64; 4]| [x.hypot(y), xx.hypot(yy)];
    let ([edge_a, point_a], [edge_b, point_b]) = (strengths(a), strengths(b));
    let greatest = (edge_a - edge_b).abs().max((point_a - point_b).abs());
    (std::f64::consts::FRAC_1_SQRT_2 * greatest).powf(FEATURE_COMPRESSION)
}

/// A separable filter: the weights of each channel at integer distances from `-radius` to `radius`. Borders repeat the outermost pixel.
struct Taps<const N: usize> {
    radius: usize,
    weights: Vec<[f64; N]>,
}

impl<const N: usize> Taps<N> {
    /// Weights by distance in pixels.
    fn new(radius: usize, weight: impl Fn(f64) -> [f64; N]) -> Self {
        let distance = |i: usize| i as f64 - radius as f64;
        Self { radius, weights: (0..=2 * radius).map(|i| weight(distance(i))).collect() }
    }

    /// The sum of each channel's weights.
    fn sums(&self) -> [f64; N] {
        self.weights.iter().fold([0.0; N], |sums, weight| std::array::from_fn(|k| sums[k] + weight[k]))
    }

    /// Scales each channel so that its positive weights sum to 1 and its negative weights to -1.
    fn normalized(mut self) -> Self {
        for channel in 0..N {
            let sum = |sign: f64| self.weights.iter().map(|w| (sign * w[channel]).max(0.0)).sum::<f64>();
            let sums = [sum(1.0), sum(-1.0)];
            for weight in &mut self.weights {
                weight[channel] /= if weight[channel] < 0.0 { sums[1] } else { sums[0] };
            }
        }
        self
    }

    /// Filters each channel along rows.
    fn along_rows(&self, plane: &Plane<N>) -> Plane<N> {
        let mut values = vec![[0.0; N]; plane.values.len()];
        let width = plane.width;
        values.par_chunks_mut(width).zip(plane.values.par_chunks(width)).for_each(|(out, row)| {
            for (x, out) in out.iter_mut().enumerate() {
                for (k, weight) in self.weights.iter().enumerate() {
                    add(out, weight, &row[(x + k).saturating_sub(self.radius).min(width - 1)]);
                }
            }
        });
        Plane { width, values }
    }

    /// Filters each channel along columns.
    fn along_columns(&self, plane: &Plane<N>) -> Plane<N> {
        let mut values = vec![[0.0; N]; plane.values.len()];
        let width = plane.width;
        let height = plane.values.len() / width;
        values.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            for (k, weight) in self.weights.iter().enumerate() {
                let row = (y + k).saturating_sub(self.radius).min(height - 1) * width;
                for (out, value) in out.iter_mut().zip(&plane.values[row..row + width]) {
                    add(out, weight, value);
                }
            }
        });
        Plane { width, values }
    }
}

#[inline]
fn add<const N: usize>(sums: &mut [f64; N], weights: &[f64; N], values: &[f64; N]) {
    for channel in 0..N {
        sums[channel] += weights[channel] * values[channel];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_inverted() {
        let [shown, ..] = tone_mapped([inverse_curve(SHOWN) / 8.0; 3], 3.0);
        assert!((shown - SHOWN).abs() < 1e-12, "{shown}");
        assert_eq!(tone_mapped([0.0, 1e38, 1e300], 0.0), [0.0, 1.0, 1.0]);
    }

    #[test]
    fn exposures_go_from_the_brightest_to_the_median() {
        let exposures = exposures(&[[1.0; 3], [1.0; 3], [32.0; 3]]);
        assert_eq!(exposures.len(), 5);
        assert!((exposures[4] - exposures[0] - 5.0).abs() < 1e-12, "{exposures:?}");
        assert!(super::exposures(&[[0.0; 3]; 4]).iter().all(|x| x.is_finite()), "of a black reference");
    }

    #[test]
    fn a_step_is_an_edge_of_the_same_height() {
        // Luma 0 to the left and 1 to the right: next to the step, only the positive half of the filter covers 1.
        let values = (0..64).map(|x| if x % 32 < 16 { [-16.0, 0.0, 0.0] } else { [100.0, 0.0, 0.0] }).collect();
        let plane = features(&Plane { width: 32, values }, 20.0);
        let [x, y, ..] = plane.values[16];
        assert!((x.abs() - 1.0).abs() < 1e-12 && y.abs() < 1e-12, "{x} {y}");
        assert!(plane.values[0].iter().all(|x| x.abs() < 1e-12), "no feature far from the step");
    }

    #[test]
    fn borders_repeat_and_axes_differ() {
        let plane = Plane { width: 3, values: vec![[1.0], [2.0], [4.0], [8.0], [16.0], [32.0]] };
        let before = Taps::new(1, |x| [if x < 0.0 { 1.0 } else { 0.0 }]);
        assert_eq!(before.along_rows(&plane).values.as_flattened(), [1.0, 1.0, 2.0, 8.0, 8.0, 16.0]);
        assert_eq!(before.along_columns(&plane).values.as_flattened(), [1.0, 2.0, 4.0, 1.0, 2.0, 4.0]);
    }

    const SIZE: [u32; 2] = [40, 28];

    /// Multiples of 1/64 in 0..=1: tiles of three values with noise, shifted by `shift` pixels, as in `tests/oracle/flip.py`.
    fn picture(shift: u32, is_hdr: bool) -> Picture {
        let mut picture = Picture::filled(SIZE[0], SIZE[1], [0.0; 3]);
        for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
            let index = picture.index(x, y);
            for (c, channel) in (0..).zip(&mut picture.pixels[index]) {
                let tile = ((x + shift) / 7 + y / 5) % 3;
                let grain = (x * 13 + y * 29 + c * 17 + x * y * (c + 3)) % 11;
                let value = (tile * 21 + grain * (1 + shift) + c * 4 * shift).min(64);
                let gain = if is_hdr { ((x / 8) as f32 - 1.0).exp2() } else { 1.0 };
                *channel = value as f32 / 64.0 * gain;
            }
        }
        picture
    }

    /// Output of `flip-evaluator` 1.7 in `tests/oracle/flip.py`: pixels per degree, mean, and errors at [`POSITIONS`].
    type Published = (f64, f64, [f64; 4]);
    const POSITIONS: [[u32; 2]; 4] = [[0, 0], [11, 9], [39, 27], [20, 14]];

    /// The authors' program computes in `f32`: sums over about 400 weights and powers keep five digits.
    const THEIR_ROUNDING: f64 = 2e-5;

    #[track_caller]
    fn assert_published(flip: &Flip, &(pixels_per_degree, mean, places): &Published) {
        let close = |a: f64, b: f64| (a - b).abs() < THEIR_ROUNDING;
        assert!(close(flip.mean(), mean), "{pixels_per_degree}: mean {} is not {mean}", flip.mean());
        for ([x, y], want) in POSITIONS.into_iter().zip(places) {
            let got = flip.errors()[(y * SIZE[0] + x) as usize].unwrap();
            assert!(close(got, want), "{pixels_per_degree}: at ({x}, {y}) {got} is not {want}");
        }
    }

    #[test]
    fn ldr_errors_match_the_reference() {
        for published in [
            (PIXELS_PER_DEGREE, 0.461_863_0, [0.617_201, 0.387_120, 0.440_873, 0.439_847]),
            (30.0, 0.516_713_9, [0.636_657, 0.371_347, 0.435_173, 0.672_631]),
        ] {
            assert_published(&flip(&picture(1, false), &picture(0, false), published.0).unwrap(), &published);
        }
    }

    #[test]
    fn hdr_errors_match_the_reference() {
        for published in [
            (PIXELS_PER_DEGREE, 0.435_380_1, [0.728_206, 0.403_897, 0.317_787, 0.334_842]),
            (30.0, 0.487_107_3, [0.768_770, 0.393_750, 0.253_116, 0.538_414]),
        ] {
            assert_published(&flip_hdr(&picture(1, true), &picture(0, true), published.0).unwrap(), &published);
        }
    }

    #[test]
    fn equal_pictures_have_no_error_and_the_order_hardly_matters() {
        let [a, b] = [0, 1].map(|shift| picture(shift, false));
        assert!(flip(&a, &a, PIXELS_PER_DEGREE).unwrap().errors().iter().all(|&error| error == Some(0.0)));
        let [forth, back] = [(&a, &b), (&b, &a)].map(|(a, b)| flip(a, b, PIXELS_PER_DEGREE).unwrap().mean());
        assert!((forth - back).abs() < 1e-12, "LDR-FLIP is symmetric: {forth} {back}");
    }

    #[test]
    fn pixels_that_are_not_finite_have_no_error() {
        let (a, mut b) = (picture(1, false), picture(0, false));
        b.pixels[7] = [f32::NAN; 3];
        let found = flip(&a, &b, PIXELS_PER_DEGREE).unwrap();
        assert!(found.errors()[7].is_none() && found.mean().is_finite());
        assert_eq!(found.picture().pixels[7], [1.0, 0.0, 1.0]);
        b.pixels.fill([f32::INFINITY; 3]);
        assert_eq!(flip_hdr(&a, &b, PIXELS_PER_DEGREE), Err(CompareError::NothingFinite));
        let small = Picture::filled(1, 1, [0.0; 3]);
        assert!(matches!(flip(&small, &b, PIXELS_PER_DEGREE), Err(CompareError::Size { .. })));
    }
}
