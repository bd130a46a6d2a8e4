//! Pictures in linear RGB, and the exposure and tone curves for formats of 8 and 16 bits. Linear formats stay linear.

use crate::srgb;

/// A picture in linear RGB, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels, row by row.
    pub pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture of one color.
    #[must_use]
    pub fn filled(width: u32, height: u32, color: [f32; 3]) -> Self {
        Self { width, height, pixels: vec![color; width as usize * height as usize] }
    }

    /// Index of a pixel in [`Picture::pixels`]; `x` is less than the width, `y` less than the height.
    #[must_use]
    pub fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }

    /// The part of the picture with this top left corner and this size.
    ///
    /// # Panics
    /// If it exceeds the picture.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        let pixels = cropped(&self.pixels, self.width, corner, size);
        Self { width: size[0], height: size[1], pixels }
    }

    /// Fills a rectangle given by its top left corner and its size, clipped to the picture.
    pub(crate) fn fill(&mut self, [left, top]: [u32; 2], [width, height]: [u32; 2], color: [f32; 3]) {
        for y in top..top.saturating_add(height).min(self.height) {
            for x in left..left.saturating_add(width).min(self.width) {
                let index = self.index(x, y);
                self.pixels[index] = color;
            }
        }
    }
}

/// The values in a rectangle of a picture of `width` pixels in a row.
pub(crate) fn cropped<T: Copy>(all: &[T], width: u32, [left, top]: [u32; 2], [columns, rows]: [u32; 2]) -> Vec<T> {
    let row = |y: u32| y as usize * width as usize + left as usize;
    (top..top + rows).flat_map(|y| &all[row(y)..row(y) + columns as usize]).copied().collect()
}

/// A curve from scene-referred radiance to the range of a display, both linear RGB with the primaries of sRGB.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// Clamps to 0..=1.
    #[default]
    None,
    /// AgX by Troy Sobotka, base look, in the polynomial fit of Wrensch 2023: soft shoulder, colors fade towards white.
    Agx,
    /// The reference and sRGB output transforms of ACES, in the fit of Hill 2015: strong contrast.
    Aces,
    /// Khronos PBR Neutral 2024, for glTF: colors below 0.8 nearly as they are, highlights compressed.
    FilmicNeutral,
}

impl ToneMap {
    /// All curves.
    pub const ALL: [Self; 4] = [Self::None, Self::Agx, Self::Aces, Self::FilmicNeutral];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Agx => "agx",
            Self::Aces => "aces",
            Self::FilmicNeutral => "filmic-neutral",
        }
    }

    /// The display value of a radiance, each component in 0..=1. What is not a number or negative counts as 0.
    ///
    /// ```
    /// use canted_film::ToneMap;
    ///
    /// assert_eq!(ToneMap::None.map([0.5, 2.0, -1.0]), [0.5, 1.0, 0.0]);
    /// assert!(ToneMap::FilmicNeutral.map([4.0; 3])[0] < 1.0);
    /// ```
    #[must_use]
    pub fn map(self, radiance: [f32; 3]) -> [f32; 3] {
        /// Brighter values are white under every curve, and their products stay finite.
        const MAX: f32 = 1e8;
        // `max` returns the other operand for NaN.
        let color = radiance.map(|x| if x > 0.0 { x.min(MAX) } else { 0.0 });
        let mapped = match self {
            Self::None => color,
            Self::Agx => agx(color),
            Self::Aces => aces(color),
            Self::FilmicNeutral => neutral(color),
        };
        mapped.map(|x| x.clamp(0.0, 1.0))
    }
}

/// A matrix by rows times a vector.
fn times(rows: [[f32; 3]; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    rows.map(|[a, b, c]| a * x + b * y + c * z)
}

/// Source: Wrensch 2023, "Minimal AgX implementation".
fn agx(color: [f32; 3]) -> [f32; 3] {
    const INSET: [[f32; 3]; 3] = [
        [0.842_479, 0.078_433_6, 0.079_223_745],
        [0.042_328_24, 0.878_468_6, 0.079_166_13],
        [0.042_375_655, 0.078_433_6, 0.879_143],
    ];
    const OUTSET: [[f32; 3]; 3] = [
        [1.196_879, -0.098_020_88, -0.099_029_74],
        [-0.052_896_85, 1.151_903_1, -0.098_961_18],
        [-0.052_971_635, -0.098_043_45, 1.151_073_7],
    ];
    /// The range of the curve, as powers of two.
    const RANGE: [f32; 2] = [-12.473_93, 4.026_069];
    let curve = |x: f32| {
        let t = (x.max(f32::MIN_POSITIVE).log2().clamp(RANGE[0], RANGE[1]) - RANGE[0]) / (RANGE[1] - RANGE[0]);
        let coefficients = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.002_32];
        coefficients.into_iter().fold(0.0, |sum, c| sum * t + c)
    };
    // The curve ends in display values of a gamma of 2.2.
    times(OUTSET, times(INSET, color).map(curve)).map(|x| x.max(0.0).powf(2.2))
}

/// Source: Hill 2015, fit of the ACES reference and output device transforms.
fn aces(color: [f32; 3]) -> [f32; 3] {
    const INPUT: [[f32; 3]; 3] =
        [[0.597_19, 0.354_58, 0.048_23], [0.076, 0.908_34, 0.015_66], [0.0284, 0.133_83, 0.837_77]];
    const OUTPUT: [[f32; 3]; 3] =
        [[1.604_75, -0.531_08, -0.073_67], [-0.102_08, 1.108_13, -0.006_05], [-0.003_27, -0.072_76, 1.076_02]];
    let curve = |x: f32| {
        let x = x.min(1e4);
        (x * (x + 0.024_578_6) - 0.000_090_537) / (x * (0.983_729 * x + 0.432_951) + 0.238_081)
    };
    times(OUTPUT, times(INPUT, color).map(curve))
}

/// Source: Khronos PBR Neutral Tone Mapper 2024.
fn neutral(color: [f32; 3]) -> [f32; 3] {
    /// Reflectance of a dielectric at normal incidence, which the curve takes away.
    const F90: f32 = 0.04;
    const START: f32 = 0.8 - F90;
    const DESATURATION: f32 = 0.15;
    let [r, g, b] = color;
    let least = r.min(g).min(b);
    let offset = if least < 2.0 * F90 { least - least * least / (4.0 * F90) } else { F90 };
    let color = color.map(|x| x - offset);
    let peak = color.into_iter().fold(0.0, f32::max);
    if peak < START {
        return color;
    }
    let depth = 1.0 - START;
    let new_peak = 1.0 - depth * depth / (peak + depth - START);
    let white = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.map(|x| {
        let scaled = x * (new_peak / peak);
        scaled + (new_peak - scaled) * white
    })
}

impl Picture {
    /// Multiplies by `2^stops`.
    #[must_use]
    pub fn exposed(&self, stops: f32) -> Self {
        self.mapped(|color| color.map(|x| x * stops.exp2()))
    }

    /// Applies a tone curve to each pixel.
    #[must_use]
    pub fn tone_mapped(&self, curve: ToneMap) -> Self {
        self.mapped(|color| curve.map(color))
    }

    fn mapped(&self, map: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        Self { pixels: self.pixels.iter().map(|&color| map(color)).collect(), ..*self }
    }

    /// The exposure in stops that makes the logarithmic mean of the luminance a middle gray of 0.18, in -10..=10.
    ///
    /// Pixels darker than a thousandth of the mean are background; 0 for a black picture.
    #[must_use]
    pub fn auto_exposure(&self) -> f32 {
        const GRAY: f64 = 0.18;
        const LIMIT: f32 = 10.0;
        let all = || self.pixels.iter().map(|color| srgb::luminance(color.map(f64::from))).filter(|x| x.is_finite());
        let mean = all().sum::<f64>() / self.pixels.len().max(1) as f64;
        let (sum, n) =
            all().filter(|&x| x > 1e-3 * mean && x > 0.0).fold((0.0, 0), |(sum, n), x| (sum + x.ln(), n + 1));
        if n == 0 { 0.0 } else { ((GRAY.ln() - sum / f64::from(n)) / 2.0_f64.ln()) as f32 }.clamp(-LIMIT, LIMIT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CURVES: [ToneMap; 4] = [ToneMap::None, ToneMap::Agx, ToneMap::Aces, ToneMap::FilmicNeutral];

    /// Values of the published formulas, computed apart from this code.
    #[test]
    fn curves_have_the_published_values() {
        for (curve, input, want) in [
            // 0.5 - 0.04 and, below 0.08, 6.25 x^2.
            (ToneMap::FilmicNeutral, 0.5, 0.46),
            (ToneMap::FilmicNeutral, 0.04, 0.01),
            // Peak 1.96: 1 - 0.0576 / (1.96 + 0.24 - 0.76).
            (ToneMap::FilmicNeutral, 2.0, 0.96),
            // 0.18 * 0.2045786 = 0.03682415 less 0.000090537, over 0.18 * 0.61002222 + 0.238081; rows sum to 1.
            (ToneMap::Aces, 0.18, 0.105_603),
        ] {
            let [r, g, b] = curve.map([input; 3]);
            assert!(
                (r - want).abs() < 2e-4 && (g - want).abs() < 2e-4 && (b - want).abs() < 2e-4,
                "{curve:?} {r} {g} {b}"
            );
        }
        // AgX maps middle gray near to middle gray.
        let [gray, ..] = ToneMap::Agx.map([0.18; 3]);
        assert!((0.16..0.24).contains(&gray), "{gray}");
    }

    #[test]
    fn curves_rise_from_black_to_white_and_accept_any_number() {
        for curve in CURVES {
            let mut last = 0.0;
            for step in 0..400_i16 {
                let [x, ..] = curve.map([(f32::from(step) / 20.0 - 12.0).exp2(); 3]);
                assert!(x >= last - 2e-3 && x <= 1.0, "{curve:?} {step}: {x} after {last}");
                last = x;
            }
            assert!(last > 0.98, "{curve:?}: {last}");
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MAX] {
                let mapped = curve.map([bad, 0.5, 0.0]);
                assert!(mapped.iter().all(|x| (0.0..=1.0).contains(x)), "{curve:?} {bad}: {mapped:?}");
            }
        }
    }

    #[test]
    fn automatic_exposure_brings_the_mean_to_middle_gray() {
        let gray = |x: f32| Picture::filled(2, 2, [x; 3]);
        assert!((gray(0.18).auto_exposure()).abs() < 1e-6);
        assert!((gray(0.72).auto_exposure() + 2.0).abs() < 1e-6);
        assert!((gray(0.72).exposed(-2.0).pixels[0][0] - 0.18).abs() < 1e-6);
        assert_eq!(gray(0.0).auto_exposure(), 0.0);
        assert_eq!(gray(f32::NAN).auto_exposure(), 0.0);
        assert_eq!(gray(1e-30).auto_exposure(), 10.0);
        // A black background does not count.
        let mut half = gray(0.18);
        half.pixels[..2].fill([0.0; 3]);
        assert!(half.auto_exposure().abs() < 1e-6);
    }
}
