use std::f64::consts::PI;
use std::fmt;

/// How the light around a pixel's centre is weighed, the same along both axes; each with its radius in pixels, beyond
/// which it is zero.
///
/// A picture is light times the filter, at whole pixels. A wide filter blurs, a narrow one lets steep edges and small
/// patterns alias. Names and forms are those of Mitchell and Netravali 1988 and of Pharr et al. 2023, *Physically Based
/// Rendering*, section 8.8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// One everywhere.
    Box(f32),
    /// Falls in a straight line.
    Tent(f32),
    /// A Gaussian whose standard deviation is a third of the radius, less its value at the radius.
    Gaussian(f32),
    /// The cubic of Mitchell and Netravali 1988 with B = C = 1/3, its support stretched to the radius: sharpens edges by
    /// negative weight around the middle.
    Mitchell(f32),
    /// The window of four cosines of Harris 1978: hardly any ripple, never negative.
    BlackmanHarris(f32),
}

/// The name, as `--filter` has it; the radius behind it where it is another than that of the constant.
impl fmt::Display for Filter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, usual) = match self {
            Self::Box(_) => ("box", Self::BOX),
            Self::Tent(_) => ("tent", Self::TENT),
            Self::Gaussian(_) => ("gaussian", Self::GAUSSIAN),
            Self::Mitchell(_) => ("mitchell", Self::MITCHELL),
            Self::BlackmanHarris(_) => ("blackman-harris", Self::BLACKMAN_HARRIS),
        };
        if *self == usual { f.write_str(name) } else { write!(f, "{name} of radius {}", self.radius()) }
    }
}

impl Filter {
    /// The pixel's own square.
    pub const BOX: Self = Self::Box(0.5);
    /// As far as the neighbours' centres: straight ramps stay straight.
    pub const TENT: Self = Self::Tent(1.0);
    /// Standard deviation of half a pixel.
    pub const GAUSSIAN: Self = Self::Gaussian(1.5);
    /// As its authors have it.
    pub const MITCHELL: Self = Self::Mitchell(2.0);
    /// Falls to half at about half a pixel.
    pub const BLACKMAN_HARRIS: Self = Self::BlackmanHarris(1.5);

    /// Distance in pixels, along each axis, beyond which the filter is zero.
    #[must_use]
    pub fn radius(self) -> f32 {
        match self {
            Self::Box(r) | Self::Tent(r) | Self::Gaussian(r) | Self::Mitchell(r) | Self::BlackmanHarris(r) => r,
        }
    }

    /// The filter along one axis, `x` pixels from the centre, up to a constant factor.
    #[must_use]
    pub fn value(self, x: f64) -> f64 {
        let x = x.abs() / f64::from(self.radius());
        if x > 1.0 {
            return 0.0;
        }
        match self {
            Self::Box(_) => 1.0,
            Self::Tent(_) => 1.0 - x,
            Self::Gaussian(_) => (-4.5 * x * x).exp() - (-4.5_f64).exp(),
            Self::Mitchell(_) => mitchell(2.0 * x),
            Self::BlackmanHarris(_) => [0.358_75, 0.488_29, 0.141_28, 0.011_68]
                .into_iter()
                .zip([0.0, 1.0, 2.0, 3.0])
                .map(|(a, k)| a * (k * PI * x).cos())
                .sum(),
        }
    }
}

impl Default for Filter {
    fn default() -> Self {
        Self::BOX
    }
}

/// The cubic pieces for B = C = 1/3; zero at 8/7 and, twice, at 2.
fn mitchell(x: f64) -> f64 {
    if x < 1.0 { ((7.0 * x - 12.0) * x * x + 16.0 / 3.0) / 6.0 } else { (8.0 - 7.0 * x) * (2.0 - x) * (2.0 - x) / 18.0 }
}

/// Steps of a table along the radius. The zero of Mitchell's filter, at 4/7 of the radius, lies between two of them, and so
/// does the joint of its pieces at 1/2.
const STEPS: usize = 896;

/// Places samples about a pixel's centre as a [`Filter`] weighs it, so that their mean is the filtered picture.
///
/// Filter importance sampling after Ernst et al. 2006: a sample belongs to one pixel alone, and no pixel waits for its
/// neighbours. Where a filter is negative, the absolute value chooses the place and the sample's weight is -1; everywhere
/// else it is 1. A pixel is the sum of weighed samples over the sum of weights, so that even light stays even.
///
/// Places come from a table of the integral, linear between its steps `h`: the response to an edge is that of the filter
/// up to `h²/8` times the filter's greatest slope, less than `10⁻⁶` for radii of a few pixels.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    filter: Filter,
    /// Share of the integral of the absolute value over the radius that lies before each step; the last is 1.
    before: Vec<f64>,
    /// Whether the filter is negative anywhere.
    is_signed: bool,
}

impl FilterSampler {
    /// Tabulates `filter`; `None` where its radius is not finite and above zero.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "few steps")]
    pub fn new(filter: Filter) -> Option<Self> {
        let radius = filter.radius();
        if !(radius > 0.0 && radius.is_finite()) {
            return None;
        }
        let at = |step: f64| filter.value(f64::from(radius) * step / STEPS as f64);
        // Simpson's rule over a step: exact for cubics.
        let masses: Vec<f64> =
            (0..STEPS).map(|i| i as f64).map(|i| (at(i) + 4.0 * at(i + 0.5) + at(i + 1.0)) / 6.0).collect();
        let mut sum = 0.0;
        let before = std::iter::once(0.0).chain(masses.iter().map(|mass| {
            sum += mass.abs();
            sum
        }));
        let before: Vec<f64> = before.collect();
        let all = before[STEPS];
        let is_signed = masses.iter().any(|&mass| mass < 0.0);
        Some(Self { filter, before: before.into_iter().map(|x| x / all).collect(), is_signed })
    }

    /// Whether samples may weigh -1.
    #[must_use]
    pub fn is_signed(&self) -> bool {
        self.is_signed
    }

    /// The table as a device reads it: the share before each step.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub fn table(&self) -> Vec<f32> {
        self.before.iter().map(|&before| before as f32).collect()
    }

    /// Where a sample lies from the pixel's centre, in pixels, and what it weighs, for a point of the unit square.
    #[must_use]
    pub fn place(&self, square: [f32; 2]) -> ([f64; 2], f32) {
        // Exact, so that the box of one pixel puts a sample where the point is in the pixel.
        let [x, y] = square.map(|s| 2.0 * f64::from(s) - 1.0);
        if let Filter::Box(radius) = self.filter {
            return ([x, y].map(|s| s * f64::from(radius)), 1.0);
        }
        let ((x, x_weight), (y, y_weight)) = (self.along(x), self.along(y));
        ([x, y], x_weight * y_weight)
    }

    /// The place along one axis, and its weight, for a number from -1 to 1.
    #[expect(clippy::cast_precision_loss, reason = "few steps")]
    fn along(&self, signed: f64) -> (f64, f32) {
        let share = signed.abs();
        // The step that begins at or before the share; the last one for a share of 1.
        let step = self.before[..STEPS].partition_point(|&before| before <= share) - 1;
        let (start, end) = (self.before[step], self.before[step + 1]);
        let inside = (share - start) / (end - start);
        let x = f64::from(self.filter.radius()) * (step as f64 + inside) / STEPS as f64;
        // No step has both signs.
        let middle = f64::from(self.filter.radius()) * (step as f64 + 0.5) / STEPS as f64;
        (x.copysign(signed), if self.filter.value(middle) < 0.0 { -1.0 } else { 1.0 })
    }
}
