use std::f64::consts::PI;
use std::fmt;

/// Pixel reconstruction filter: separable, with a radius in pixels beyond which it is zero.
///
/// Wide filters blur; narrow ones alias. Names and formulas follow Mitchell and Netravali 1988 and Pharr et al. 2023,
/// *Physically Based Rendering*, section 8.8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// Constant.
    Box(f32),
    /// Linear falloff.
    Tent(f32),
    /// A Gaussian with a standard deviation of a third of the radius, minus its value at the radius.
    Gaussian(f32),
    /// The cubic of Mitchell and Netravali 1988 with B = C = 1/3, scaled to the radius: negative lobes sharpen edges.
    Mitchell(f32),
    /// The four-term window of Harris 1978: little ringing, never negative.
    BlackmanHarris(f32),
}

/// The name, and the radius unless it is the usual one.
impl fmt::Display for Filter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.name();
        if Self::ALL.contains(self) { f.write_str(name) } else { write!(f, "{name} of radius {}", self.radius()) }
    }
}

impl Filter {
    /// One pixel.
    pub const BOX: Self = Self::Box(0.5);
    /// Reaches the centers of the neighbors, so linear ramps stay linear.
    pub const TENT: Self = Self::Tent(1.0);
    /// A standard deviation of half a pixel.
    pub const GAUSSIAN: Self = Self::Gaussian(1.5);
    /// The radius of the authors.
    pub const MITCHELL: Self = Self::Mitchell(2.0);
    /// Half of the maximum at about half a pixel.
    pub const BLACKMAN_HARRIS: Self = Self::BlackmanHarris(1.5);

    /// All filters, with their usual radii.
    pub const ALL: [Self; 5] = [Self::BOX, Self::TENT, Self::GAUSSIAN, Self::MITCHELL, Self::BLACKMAN_HARRIS];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Box(_) => "box",
            Self::Tent(_) => "tent",
            Self::Gaussian(_) => "gaussian",
            Self::Mitchell(_) => "mitchell",
            Self::BlackmanHarris(_) => "blackman-harris",
        }
    }

    /// Radius along each axis, in pixels.
    #[must_use]
    pub fn radius(self) -> f32 {
        match self {
            Self::Box(r) | Self::Tent(r) | Self::Gaussian(r) | Self::Mitchell(r) | Self::BlackmanHarris(r) => r,
        }
    }

    /// The filter along one axis, `x` pixels from the center, up to a constant factor.
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

/// The cubic pieces for B = C = 1/3; roots at 8/7 and a double root at 2.
fn mitchell(x: f64) -> f64 {
    if x < 1.0 { ((7.0 * x - 12.0) * x * x + 16.0 / 3.0) / 6.0 } else { (8.0 - 7.0 * x) * (2.0 - x) * (2.0 - x) / 18.0 }
}

/// Table steps along the radius. The root of Mitchell's filter, at 4/7 of the radius, and the joint of its pieces at 1/2
/// lie between two steps.
const STEPS: usize = 896;

/// Distributes samples around the center of a pixel in proportion to a [`Filter`].
///
/// Filter importance sampling (Ernst et al. 2006): each sample belongs to one pixel, so pixels are independent. Where the
/// filter is negative, positions follow its absolute value and the weight of a sample is -1; elsewhere it is 1. A pixel is
/// the weighted mean of its samples, so constant light stays constant.
///
/// Positions come from a table of the integral, linear between steps of size `h`: the response to an edge differs from the
/// filter's by at most `h²/8` times its greatest slope, less than `10⁻⁶` for radii of a few pixels.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    filter: Filter,
    /// Cumulative share of the integral of the absolute value before each step; the last is 1.
    before: Vec<f64>,
    /// Whether the filter is negative anywhere.
    is_signed: bool,
}

impl FilterSampler {
    /// Tabulates `filter`; `None` unless its radius is finite and positive.
    #[must_use]
    pub fn new(filter: Filter) -> Option<Self> {
        let radius = filter.radius();
        if !(radius > 0.0 && radius.is_finite()) {
            return None;
        }
        let at = |step: f64| filter.value(f64::from(radius) * step / STEPS as f64);
        // Simpson's rule is exact for cubics.
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

    /// Whether weights may be -1.
    #[must_use]
    pub fn is_signed(&self) -> bool {
        self.is_signed
    }

    /// The table in `f32`, for GPUs. An entry is negative where the filter is negative in the step that starts there. Entries are rounded
    /// up, so a share in `f32` has the same step, and therefore the same sign, as in [`FilterSampler::sample`].
    #[must_use]
    pub fn table(&self) -> Vec<f32> {
        let rounded_up = |before: f64| {
            let nearest = before as f32;
            if f64::from(nearest) < before { nearest.next_up() } else { nearest }
        };
        let signs = (0..STEPS).map(|step| self.sign(step)).chain([1.0]);
        self.before.iter().zip(signs).map(|(&before, sign)| sign * rounded_up(before)).collect()
    }

    /// The sign of the filter in a step, which is constant.
    fn sign(&self, step: usize) -> f32 {
        let center = f64::from(self.filter.radius()) * (step as f64 + 0.5) / STEPS as f64;
        if self.filter.value(center) < 0.0 { -1.0 } else { 1.0 }
    }

    /// Offset of a sample from the center of the pixel, in pixels, and its weight, for a point in the unit square.
    #[must_use]
    pub fn sample(&self, square: [f32; 2]) -> ([f64; 2], f32) {
        // Exact: the box of one pixel maps the unit square to the pixel.
        let [x, y] = square.map(|s| 2.0 * f64::from(s) - 1.0);
        if let Filter::Box(radius) = self.filter {
            return ([x, y].map(|s| s * f64::from(radius)), 1.0);
        }
        let ((x, x_weight), (y, y_weight)) = (self.along(x), self.along(y));
        ([x, y], x_weight * y_weight)
    }

    /// Offset and weight along one axis, for a number from -1 to 1.
    fn along(&self, signed: f64) -> (f64, f32) {
        let share = signed.abs();
        // The step that starts at or before the share; the last one for a share of 1.
        let step = self.before[..STEPS].partition_point(|&before| before <= share) - 1;
        let (start, end) = (self.before[step], self.before[step + 1]);
        let inside = (share - start) / (end - start);
        let x = f64::from(self.filter.radius()) * (step as f64 + inside) / STEPS as f64;
        (x.copysign(signed), self.sign(step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sign that a kernel finds for a share of the integral.
    fn sign_in_table(table: &[f32], share: f32) -> f32 {
        let step = table[..STEPS].partition_point(|before| before.abs() <= share) - 1;
        1.0_f32.copysign(table[step])
    }

    #[test]
    fn the_table_of_devices_has_the_signs_of_samples() {
        for filter in [Filter::MITCHELL, Filter::Mitchell(0.7), Filter::GAUSSIAN, Filter::TENT] {
            let sampler = FilterSampler::new(filter).unwrap();
            let table = sampler.table();
            assert_eq!(table.iter().any(|&before| before < 0.0), sampler.is_signed(), "{filter}");
            for before in &table[..STEPS] {
                // Numbers of the sampler are multiples of 2^-24, so shares are multiples of 2^-23.
                let nearest = (before.abs() * 8_388_608.0).round();
                for share in [-1.0, 0.0, 1.0].map(|d| ((nearest + d) / 8_388_608.0).clamp(0.0, 1.0)) {
                    let (_, weight) = sampler.sample([0.5 + 0.5 * share, 0.5]);
                    assert_eq!(sign_in_table(&table, share), weight, "{filter}: {share}");
                }
            }
        }
    }
}
