//! Removes the noise of few samples from a picture.
//!
//! ```text
//! reads   mean and variance of each pixel; albedo, shading normal and depth of its first hits
//! writes  a picture
//! stages  demodulate -> estimate variance -> filter level by level -> modulate
//! holds   same input, same bits, for any number of threads; a pixel depends on pixels at most [`REACH`] away
//! source  Dammertz, Sewtz, Hanika and Lensch 2010, Edge-Avoiding À-Trous Wavelet Transform; the variance that guides the
//!         color weight and its propagation from level to level are those of Schied et al. 2017 (SVGF)
//! ```
//!
//! Departures from the sources: color weights compare all three channels, because equal
//! luminance may hide an edge; normals are compared by distance, because means of unit vectors are shorter at edges; there
//! is no history of earlier frames.
//!
//! The filter is biased. It loses detail that is weaker than the noise, and with it the rare bright samples of caustics.

use rayon::prelude::*;

use crate::{
    Film, Guide, Picture, Pixel, Tile, Tiling,
    lanes::{self, Lanes},
    tiling::Total,
};

/// Levels of the filter; level `i` has steps of `2^i` pixels.
const LEVELS: u32 = 5;

/// Greatest distance, in pixels along an axis, at which a pixel affects another one.
///
/// Each level reaches two steps and its 3 x 3 variance one pixel more; the estimate of the variance reaches
/// three pixels and the slope of the depth one.
pub const REACH: u32 = 2 * ((1 << LEVELS) - 1) + LEVELS + VARIANCE_RADIUS + 1;

/// Parameters of [`denoise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Denoise {
    /// Color difference, in standard errors, at which the weight of a pixel falls to `1/e`. Zero keeps all noise; large values blur
    /// shadows.
    pub color: f32,
    /// Difference of mean shading normals at which the weight falls to `1/e`, as a length. Zero keeps the noise of curved surfaces; 1
    /// blurs edges of 60 degrees.
    pub normal: f32,
    /// Difference of depth at which the weight falls to `1/e`, relative to what the slope of the surface explains. Zero keeps
    /// the noise of inclined surfaces; large values blur across silhouettes.
    pub depth: f32,
    /// Difference of albedo at which the weight falls to `1/e`. Light is filtered without albedo, so this only separates materials.
    pub albedo: f32,
}

impl Default for Denoise {
    fn default() -> Self {
        Self { color: 2.0, normal: 0.5, depth: 1.0, albedo: 0.4 }
    }
}

/// The picture without most of its noise.
///
/// A pixel whose filtered value is not finite keeps its mean; a pixel without samples is black and affects no other. With a variance
/// of zero everywhere, colors change by at most a millionth of the brighter of two neighbors.
#[must_use]
pub fn denoise(noisy: Noisy, config: &Denoise) -> Picture {
    let Noisy { width, height, mut light, features } = noisy;
    let size = [width as usize, height as usize];
    estimate_variance(&mut light, &features, size, config);
    let means: Vec<[f32; 3]> = light.iter().map(|light| light.color).collect();
    let mut next = light.clone();
    for level in 0..LEVELS {
        filter_level(&light, &features, &mut next, size, 1 << level, config);
        std::mem::swap(&mut light, &mut next);
    }
    drop(next);
    let modulated = |((light, mean), feature): ((&Light, &[f32; 3]), &Feature)| {
        let color: [f32; 3] = std::array::from_fn(|k| light.color[k] * feature.scale(k));
        if color.iter().all(|x| x.is_finite()) { color } else { std::array::from_fn(|k| mean[k] * feature.scale(k)) }
    };
    let pixels = light.par_iter().zip(&means).zip(&features).map(modulated).collect();
    Picture { width, height, pixels }
}

/// Added to the albedo before light is divided by it, so that black surfaces do not amplify their reflections.
const ALBEDO_FLOOR: f32 = 0.02;

/// Mean light of a pixel, divided by the albedo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Light {
    color: [f32; 3],
    /// Variance of the mean, averaged over the channels; negative where it is unknown.
    variance: f32,
}

/// The first surface of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Feature {
    /// Mean shading normal; shorter than 1 where normals differ, zero for a miss.
    normal: [f32; 3],
    /// Mean depth of the hits; zero for a miss.
    depth: f32,
    albedo: [f32; 3],
    /// Whether the pixel has a sample.
    is_present: bool,
}

impl Feature {
    /// What the light of a channel was divided by.
    fn scale(&self, channel: usize) -> f32 {
        self.albedo[channel] + ALBEDO_FLOOR
    }
}

/// A noisy picture, as the filter reads it: 48 bytes per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Noisy {
    width: u32,
    height: u32,
    light: Vec<Light>,
    features: Vec<Feature>,
}

impl Noisy {
    /// A picture without samples.
    #[must_use]
    pub fn new([width, height]: [u32; 2]) -> Self {
        let n = width as usize * height as usize;
        Self { width, height, light: vec![Light::default(); n], features: vec![Feature::default(); n] }
    }

    /// The picture of a film; `None` if it was rendered without AOVs.
    #[must_use]
    pub fn of_film(film: &Film) -> Option<Self> {
        if film.guides().is_empty() {
            return None;
        }
        let mut noisy = Self::new([film.width(), film.height()]);
        for (index, (pixel, guide)) in film.pixels().iter().zip(film.guides()).enumerate() {
            noisy.set(index, pixel, guide);
        }
        Some(noisy)
    }

    /// Adds a finished tile of a picture with AOVs.
    ///
    /// # Panics
    /// If the tile does not belong to a picture of this size.
    pub fn add(&mut self, tiling: &Tiling, tile: &Tile) {
        assert_eq!(tiling.picture_size(), [self.width, self.height], "a tile of this picture");
        for Total { index, pixel, guide, .. } in tiling.totals(tile) {
            self.set(index, &pixel, &guide);
        }
    }

    /// The part of the picture with this top left corner and this size.
    ///
    /// # Panics
    /// If it exceeds the picture.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        let light = crate::picture::cropped(&self.light, self.width, corner, size);
        let features = crate::picture::cropped(&self.features, self.width, corner, size);
        Self { width: size[0], height: size[1], light, features }
    }

    fn set(&mut self, index: usize, pixel: &Pixel, guide: &Guide) {
        // As for the AOVs, a miss counts as zero, except for the depth.
        let n = f64::from(pixel.n_taken().max(1));
        let feature = Feature {
            normal: guide.shading_normal.map(|x| (x / n) as f32),
            depth: (guide.depth / f64::from(guide.n_hits.max(1))) as f32,
            albedo: guide.albedo.map(|x| (x / n) as f32).map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 }),
            is_present: pixel.n_taken() > 0,
        };
        let mean = pixel.mean();
        let scale: [f64; 3] = std::array::from_fn(|k| f64::from(feature.scale(k)));
        let color = std::array::from_fn(|k| (mean[k] / scale[k]) as f32);
        let variances = pixel.variance_of_mean();
        let sum: f64 = (0..3).map(|k| variances[k] / (scale[k] * scale[k])).sum();
        let variance = if pixel.n_samples < 2 { -1.0 } else { (sum / 3.0) as f32 };
        self.light[index] = Light { color, variance };
        self.features[index] = feature;
    }
}

/// Radius of the square in which the variance is estimated, in pixels.
const VARIANCE_RADIUS: u32 = 3;

/// Replaces the variances by their means over similar pixels; unknown ones by the variance of the colors of similar pixels.
///
/// The variance of few samples is itself noisy: where all of four samples miss a small light, it is zero.
fn estimate_variance(light: &mut [Light], features: &[Feature], size: [usize; 2], config: &Denoise) {
    let noisy: &[Light] = light;
    let row = |y| variances_of_row(noisy, features, size, y, config);
    let estimated: Vec<Vec<f32>> = (0..size[1]).into_par_iter().map(row).collect();
    for (light, variance) in light.iter_mut().zip(estimated.into_iter().flatten()) {
        light.variance = variance;
    }
}

/// The variances of a row of pixels.
fn variances_of_row(light: &[Light], features: &[Feature], size: [usize; 2], y: usize, config: &Denoise) -> Vec<f32> {
    let rows = Rows::around(light, features, size, y, VARIANCE_RADIUS as usize, 1);
    let mut row = Vec::with_capacity(size[0]);
    for x in (0..size[0]).step_by(lanes::N) {
        let own = rows.center(x);
        let slope = slopes(features, size, [x, y]);
        let known = own.variance.is_not_negative();
        let (mut sum, mut weights) = (own.variance.where_positive(known), known);
        rows.for_each_tap(x, |other, offset| {
            let known = other.variance.is_not_negative();
            let weight = own.distance(&other, slope, offset, config).decay();
            let weight = weight.where_positive(weight).where_positive(known);
            sum = sum + (weight * other.variance).where_positive(weight);
            weights = weights + weight;
        });
        for lane in 0..lanes::N.min(size[0] - x) {
            let mean = sum.0[lane] / weights.0[lane];
            let is_known = weights.0[lane] > 0.0;
            let at = [x + lane, y];
            row.push(if is_known { mean.max(own.variance.0[lane]) } else { spread(light, features, size, at, config) });
        }
    }
    row
}

/// The variance of the colors of similar pixels.
fn spread(light: &[Light], features: &[Feature], size: [usize; 2], [x, y]: [usize; 2], config: &Denoise) -> f32 {
    let p = y * size[0] + x;
    let slope = slope(features, size, [x, y]);
    let (mut moments, mut n) = ([light[p].color, light[p].color.map(|c| c * c)], 1.0);
    for (q, offset) in taps(size, [x, y], VARIANCE_RADIUS as usize, 1) {
        let weight = (-distance(&features[p], &features[q], slope, offset, config)).exp();
        // False for NaN, too.
        if weight > 0.0 {
            for (k, &c) in light[q].color.iter().enumerate() {
                moments[0][k] += weight * c;
                moments[1][k] += weight * c * c;
            }
            n += weight;
        }
    }
    let of_channel = |k: usize| (moments[1][k] / n - (moments[0][k] / n).powi(2)).max(0.0);
    (0..3).map(of_channel).sum::<f32>() / 3.0
}

/// The B3 spline, by distance from its center in steps.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];

/// The 3 x 3 Gaussian that smooths variances, by distance from its center.
const GAUSS: [f32; 2] = [1.0 / 2.0, 1.0 / 4.0];

/// Color difference that counts as none, relative to the color: rounding.
const ROUNDING: f32 = 1e-6;

/// Share of the depth that two pixels of one surface may differ by without a slope.
const FLAT: f32 = 2e-3;

/// One level of the wavelet transform: filters `light` into `next` by a sparse 5 x 5 kernel that avoids edges, with steps of `step` pixels.
fn filter_level(
    light: &[Light],
    features: &[Feature],
    next: &mut [Light],
    size: [usize; 2],
    step: usize,
    config: &Denoise,
) {
    next.par_chunks_mut(size[0].max(1)).enumerate().for_each(|(y, row)| {
        let rows = Rows::around(light, features, size, y, 2, step);
        for (x, out) in (0..).step_by(lanes::N).zip(row.chunks_mut(lanes::N)) {
            filter_pixels(light, features, &rows, out, size, [x, y], config);
        }
    });
}

/// Filters the pixels from `x` on, at most [`lanes::N`].
fn filter_pixels(
    light: &[Light],
    features: &[Feature],
    rows: &Rows,
    out: &mut [Light],
    size: [usize; 2],
    [x, y]: [usize; 2],
    config: &Denoise,
) {
    let own = rows.center(x);
    let slope = slopes(features, size, [x, y]);
    let inverse_tolerance = per_lane(size[0], x, |x| {
        let color = light[y * size[0] + x].color;
        let brightest = color.into_iter().fold(0.0, |a: f32, c| a.max(c.abs()));
        let tolerance = config.color * smoothed_variance(light, features, size, [x, y]).sqrt() + ROUNDING * brightest;
        1.0 / tolerance.max(f32::MIN_POSITIVE)
    });
    let center = Lanes::splat(SPLINE[0] * SPLINE[0]);
    let (mut color, mut variance, mut weights) =
        (own.color.map(|c| center * c), center * center * own.variance, center);
    rows.for_each_tap(x, |other, offset| {
        let of_color = (squares(own.color, other.color) * Lanes::splat(1.0 / 3.0)).sqrt() * inverse_tolerance;
        let [i, j] = offset.map(|d| d.unsigned_abs() / rows.step);
        let weight = (of_color + own.distance(&other, slope, offset, config)).decay();
        let weight = (weight * Lanes::splat(SPLINE[i] * SPLINE[j])).where_positive(weight);
        for (sum, c) in color.iter_mut().zip(other.color) {
            *sum = *sum + (weight * c).where_positive(weight);
        }
        variance = variance + (weight * weight * other.variance).where_positive(weight);
        weights = weights + weight;
    });
    let (color, variance) = (color.map(|sum| sum / weights), variance / (weights * weights));
    for (lane, out) in out.iter_mut().enumerate() {
        let is_present = features[y * size[0] + x + lane].is_present;
        let filtered = Light { color: color.map(|c| c.0[lane]), variance: variance.0[lane] };
        *out = if is_present { filtered } else { Light::default() };
    }
}

/// A number for each of the pixels from `x` on; those beyond the last have its number.
fn per_lane(width: usize, x: usize, number: impl Fn(usize) -> f32) -> Lanes {
    Lanes(std::array::from_fn(|lane| number((x + lane).min(width - 1))))
}

/// [`slope`] of the pixels from `x` on.
fn slopes(features: &[Feature], size: [usize; 2], [x, y]: [usize; 2]) -> [Lanes; 2] {
    let each: [[f32; 2]; lanes::N] =
        std::array::from_fn(|lane| slope(features, size, [(x + lane).min(size[0] - 1), y]));
    [0, 1].map(|axis| Lanes(each.map(|slope| slope[axis])))
}

/// Sum of the squared differences of three numbers.
fn squares(a: [Lanes; 3], b: [Lanes; 3]) -> Lanes {
    let [x, y, z] = std::array::from_fn(|k| (a[k] - b[k]).squared());
    x + y + z
}

/// Neighbors in a row, a number of all of them at once.
#[derive(Clone, Copy)]
struct Pixels {
    color: [Lanes; 3],
    variance: Lanes,
    normal: [Lanes; 3],
    depth: Lanes,
    albedo: [Lanes; 3],
}

impl Pixels {
    /// [`distance`] of each pair; NaN for pixels without samples.
    #[inline(always)]
    fn distance(&self, other: &Self, slope: [Lanes; 2], offset: [isize; 2], config: &Denoise) -> Lanes {
        let [across, down] = offset.map(|d| Lanes::splat(d as f32));
        let normal = squares(self.normal, other.normal) * Lanes::splat(1.0 / (config.normal * config.normal));
        let albedo = squares(self.albedo, other.albedo) * Lanes::splat(1.0 / (3.0 * config.albedo * config.albedo));
        let explained = (slope[0] * across + slope[1] * down).abs();
        let scale = Lanes::splat(config.depth) * explained + Lanes::splat(FLAT) * self.depth;
        let depth = (self.depth - other.depth).abs() / (scale + Lanes::splat(f32::MIN_POSITIVE));
        normal + albedo + depth
    }
}

/// The rows of the taps of a row, each with one array per number, and with pixels without samples on both sides.
struct Rows {
    /// Distance of the rows to the middle one, in pixels, and their numbers.
    rows: Vec<(isize, Vec<f32>)>,
    /// The index of the middle one.
    n_above: usize,
    /// Length of an array.
    stride: usize,
    /// Pixels before the first.
    padding: usize,
    radius: isize,
    step: usize,
}

impl Rows {
    /// The rows of a sparse square of this radius around row `y`, in steps of `step` pixels.
    fn around(
        light: &[Light],
        features: &[Feature],
        [width, height]: [usize; 2],
        y: usize,
        radius: usize,
        step: usize,
    ) -> Self {
        let padding = radius * step;
        let stride = width.next_multiple_of(lanes::N) + 2 * padding;
        let radius = radius.cast_signed();
        let row = |i: isize| {
            let offset = i * step.cast_signed();
            let y = y.checked_add_signed(offset).filter(|&y| y < height)?;
            let mut numbers = vec![f32::NAN; N_NUMBERS * stride];
            for x in 0..width {
                let (light, feature) = (&light[y * width + x], &features[y * width + x]);
                let [[r, g, b], [i, j, k], [u, v, w]] = [light.color, feature.normal, feature.albedo];
                let all = [r, g, b, light.variance, i, j, k, feature.depth, u, v, w];
                if feature.is_present {
                    (0..).zip(all).for_each(|(n, number): (usize, f32)| numbers[n * stride + padding + x] = number);
                }
            }
            Some((offset, numbers))
        };
        let rows: Vec<(isize, Vec<f32>)> = (-radius..=radius).filter_map(row).collect();
        let n_above = rows.iter().filter(|(offset, _)| *offset < 0).count();
        Self { rows, n_above, stride, padding, radius, step }
    }

    /// The pixels from `x` on in the middle row.
    fn center(&self, x: usize) -> Pixels {
        self.pixels(&self.rows[self.n_above].1, self.padding + x)
    }

    #[inline(always)]
    fn pixels(&self, numbers: &[f32], at: usize) -> Pixels {
        let number = |n: usize| Lanes::of(&numbers[n * self.stride + at..]);
        let three = |n: usize| [number(n), number(n + 1), number(n + 2)];
        Pixels { color: three(0), variance: number(3), normal: three(4), depth: number(7), albedo: three(8) }
    }

    /// Visits the neighbors of the pixels from `x` on, with their offsets.
    #[inline(always)]
    fn for_each_tap(&self, x: usize, mut visit: impl FnMut(Pixels, [isize; 2])) {
        for (down, numbers) in &self.rows {
            for i in -self.radius..=self.radius {
                let across = i * self.step.cast_signed();
                if let Some(at) = (self.padding + x).checked_add_signed(across)
                    && [across, *down] != [0, 0]
                {
                    visit(self.pixels(numbers, at), [across, *down]);
                }
            }
        }
    }
}

/// Numbers of a pixel in [`Rows`].
const N_NUMBERS: usize = 11;

fn squared(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.into_iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The pixels of a sparse square around a pixel, without itself, with their offsets.
fn taps(
    [width, height]: [usize; 2],
    [x, y]: [usize; 2],
    radius: usize,
    step: usize,
) -> impl Iterator<Item = (usize, [isize; 2])> {
    let along = move |at: usize, n: usize| {
        let reach = radius.cast_signed();
        (-reach..=reach).filter_map(move |i| {
            let offset = i * step.cast_signed();
            at.checked_add_signed(offset).filter(|&at| at < n).map(|at| (at, offset))
        })
    };
    along(y, height)
        .flat_map(move |(row, dy)| along(x, width).map(move |(column, dx)| (row * width + column, [dx, dy])))
        .filter(|&(_, offset)| offset != [0, 0])
}

/// How different two surfaces are: the sum of the differences over those of the configuration. Infinite for a pixel without samples.
fn distance(p: &Feature, q: &Feature, slope: [f32; 2], offset: [isize; 2], config: &Denoise) -> f32 {
    if !q.is_present {
        return f32::INFINITY;
    }
    let normal = squared(p.normal, q.normal) / (config.normal * config.normal);
    let albedo = squared(p.albedo, q.albedo) / (3.0 * config.albedo * config.albedo);
    let explained = (slope[0] * offset[0] as f32 + slope[1] * offset[1] as f32).abs();
    let depth = (p.depth - q.depth).abs() / (config.depth * explained + FLAT * p.depth + f32::MIN_POSITIVE);
    normal + albedo + depth
}

/// Change of the depth from a pixel to the next one, by column and by row: the lesser of the differences to both sides, which does
/// not cross a silhouette.
fn slope(features: &[Feature], size: [usize; 2], [x, y]: [usize; 2]) -> [f32; 2] {
    let depth = features[y * size[0] + x].depth;
    let along = |at: usize, n: usize, index: &dyn Fn(usize) -> usize| {
        let before = at.checked_sub(1).map(|at| depth - features[index(at)].depth);
        let after = (at + 1 < n).then(|| features[index(at + 1)].depth - depth);
        match (before, after) {
            (Some(a), Some(b)) => {
                if a.abs() < b.abs() {
                    a
                } else {
                    b
                }
            }
            (a, b) => a.or(b).unwrap_or(0.0),
        }
    };
    [along(x, size[0], &|x| y * size[0] + x), along(y, size[1], &|y| y * size[0] + x)]
}

/// The variance, smoothed over the neighbors.
fn smoothed_variance(light: &[Light], features: &[Feature], size: [usize; 2], [x, y]: [usize; 2]) -> f32 {
    let p = y * size[0] + x;
    let (mut sum, mut weights) = (GAUSS[0] * GAUSS[0] * light[p].variance, GAUSS[0] * GAUSS[0]);
    for (q, [dx, dy]) in taps(size, [x, y], 1, 1) {
        if features[q].is_present {
            let weight = GAUSS[dx.unsigned_abs()] * GAUSS[dy.unsigned_abs()];
            sum += weight * light[q].variance;
            weights += weight;
        }
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::*;

    const SIDE: u32 = 96;

    /// A number in 0..1 for each pixel and key.
    fn random(index: usize, key: u32) -> f32 {
        let mut x = u32::try_from(index).unwrap().wrapping_mul(0x9e37_79b9) ^ key.wrapping_mul(0x85eb_ca6b);
        x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
        x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
        f32::from(u16::try_from((x ^ (x >> 16)) >> 16).unwrap()) / 65536.0
    }

    /// A picture whose pixels are given by column, row and index.
    fn noisy(light: impl Fn(u32, u32, usize) -> Light, feature: impl Fn(u32, u32, usize) -> Feature) -> Noisy {
        let mut noisy = Noisy::new([SIDE; 2]);
        for index in 0..noisy.light.len() {
            let at = u32::try_from(index).unwrap();
            noisy.light[index] = light(at % SIDE, at / SIDE, index);
            noisy.features[index] = feature(at % SIDE, at / SIDE, index);
        }
        noisy
    }

    /// A wall that faces the camera.
    fn wall(_: u32, _: u32, _: usize) -> Feature {
        Feature { normal: [0.0, 0.0, 1.0], depth: 3.0, albedo: [0.5; 3], is_present: true }
    }

    /// Noise around `mean` that is uniform between 0 and twice the mean: its variance is a third of the mean's square.
    fn noise(mean: f32, index: usize) -> Light {
        Light { color: [2.0 * mean * random(index, 1); 3], variance: mean * mean / 3.0 }
    }

    fn rms(picture: &Picture, expected: impl Fn(usize) -> f32) -> f64 {
        let scale = wall(0, 0, 0).scale(0);
        let squares = picture.pixels.iter().enumerate().map(|(i, c)| f64::from(c[0] / scale - expected(i)).powi(2));
        (squares.sum::<f64>() / f64::from(SIDE * SIDE)).sqrt()
    }

    /// The error of noise on surfaces with these features; without a filter it is 0.577, the standard deviation.
    fn error_on(feature: impl Fn(u32, u32, usize) -> Feature) -> f64 {
        rms(&denoise(noisy(|_, _, i| noise(1.0, i), feature), &Denoise::default()), |_| 1.0)
    }

    /// It falls to 0.23 of it.
    #[test]
    fn noise_on_a_wall_falls_to_a_quarter() {
        let error = error_on(wall);
        assert!(error < 0.577 / 4.0, "{error}");
    }

    /// Colors do not hold the filter back here, so that only the surfaces can.
    fn by_surfaces_alone() -> Denoise {
        Denoise { color: 1e6, albedo: 0.1, ..Denoise::default() }
    }

    /// The error of a noisy picture that is dark on the left and bright on the right, with these features of both halves.
    fn error_of_halves(left: Feature, right: Feature) -> f64 {
        let expected = |x: u32| if x < SIDE / 2 { 0.1 } else { 1.0 };
        let halves = noisy(|x, _, i| noise(expected(x), i), |x, _, _| if x < SIDE / 2 { left } else { right });
        rms(&denoise(halves, &by_surfaces_alone()), |i| expected(u32::try_from(i).unwrap() % SIDE))
    }

    #[test]
    fn edges_of_geometry_stay() {
        let front = wall(0, 0, 0);
        let blurred = error_of_halves(front, front);
        assert!(blurred > 0.15, "without an edge the halves must blur: {blurred}");
        let normal = Feature { normal: [1.0, 0.0, 0.0], ..front };
        let depth = Feature { depth: 3.3, ..front };
        let albedo = Feature { albedo: [0.5, 0.0, 0.0], ..front };
        let miss = Feature { is_present: true, ..Feature::default() };
        for (what, other) in [("normal", normal), ("depth", depth), ("miss", miss)] {
            // The right half alone has noise of 0.577, the left of 0.0577.
            let scale = f64::from(front.scale(0) / other.scale(0));
            let kept = error_of_halves(other, front);
            assert!(kept < 0.08 || scale > 1.0 && kept < 0.1, "{what}: {kept}");
        }
        // The same albedo in the first channel, which `rms` reads.
        let kept = error_of_halves(albedo, front);
        assert!(kept < 0.08, "albedo: {kept}");
    }

    #[test]
    fn an_inclined_wall_is_filtered_like_one_that_faces_the_camera() {
        let inclined = |x: u32, _: u32, _: usize| {
            let depth = 3.0 + 0.1 * x as f32;
            Feature { normal: [0.6, 0.0, 0.8], depth, ..wall(0, 0, 0) }
        };
        let [inclined, facing] = [error_on(inclined), error_on(wall)];
        assert!(inclined < 1.25 * facing, "{inclined}, {facing}");
    }

    /// A tap changes a channel by at most `√3 t / e` times the ratio of its weight and that of the center, where `t` is
    /// a millionth of the pixel's brightest channel; all ratios sum to 55/9. A weighted mean of 25 values adds 27 roundings of
    /// weights and sums, twice. Five levels give 4e-5.
    #[test]
    fn a_picture_without_noise_stays_within_the_bound() {
        let exact = |_, _, i: usize| Light { color: [0, 1, 2].map(|k| 2.0 * random(i, k)), variance: 0.0 };
        let before = noisy(exact, wall);
        let light = before.light.clone();
        let after = denoise(before.clone(), &Denoise::default());
        for (i, (color, light)) in after.pixels.iter().zip(&light).enumerate() {
            let brightest = light.color.into_iter().fold(0.0, f32::max);
            for (k, x) in color.iter().enumerate() {
                let change = (x / before.features[i].scale(k) - light.color[k]).abs();
                assert!(change <= 4e-5 * brightest, "pixel {i}: {change} of {brightest}");
            }
        }
        // With variance it changes.
        let mut uncertain = before.clone();
        uncertain.light.iter_mut().for_each(|light| light.variance = 0.1);
        assert!(denoise(uncertain, &Denoise::default()) != after);
    }

    #[test]
    fn a_white_furnace_stays_white() {
        let albedo = |i: usize| [0, 1, 2].map(|k| random(i, 7 + k));
        let furnace = noisy(
            |_, _, _| Light { color: [1.0; 3], variance: 0.2 },
            |_, _, i| Feature { albedo: albedo(i), ..wall(0, 0, 0) },
        );
        let features = furnace.features.clone();
        for (color, feature) in denoise(furnace, &Denoise::default()).pixels.iter().zip(&features) {
            for (k, x) in color.iter().enumerate() {
                assert!((x / feature.scale(k) - 1.0).abs() < 1e-5, "{color:?}");
            }
        }
    }

    #[test]
    fn one_sample_per_pixel_is_filtered_by_the_variance_of_neighbors() {
        let unknown = noisy(|_, _, i| Light { variance: -1.0, ..noise(1.0, i) }, wall);
        let error = rms(&denoise(unknown, &Denoise::default()), |_| 1.0);
        assert!(error < 0.577 / 4.0, "{error}");
    }

    #[test]
    fn bad_values_stay_where_they_are() {
        let mut broken = noisy(|_, _, i| noise(1.0, i), wall);
        let at = |x: usize, y: usize| y * SIDE as usize + x;
        broken.features[at(10, 10)].normal = [f32::NAN; 3];
        broken.features[at(20, 10)].depth = f32::INFINITY;
        broken.features[at(30, 10)].is_present = false;
        broken.light[at(40, 10)] = Light { color: [f32::MAX; 3], variance: f32::INFINITY };
        broken.light[at(50, 10)].variance = f32::NAN;
        broken.light[at(60, 10)] = Light { color: [-1e30, 1e30, 0.0], variance: 1e38 };
        let picture = denoise(broken, &Denoise::default());
        for (i, color) in picture.pixels.iter().enumerate() {
            assert!(color.iter().all(|x| x.is_finite()), "pixel {i}: {color:?}");
        }
        assert_eq!(picture.pixels[at(30, 10)], [0.0; 3], "a pixel without samples is black");
        // Out of reach nothing changes.
        let first = at(0, 11 + REACH as usize);
        let without = denoise(noisy(|_, _, i| noise(1.0, i), wall), &Denoise::default());
        assert!(picture.pixels[..first] != without.pixels[..first]);
        assert_eq!(picture.pixels[first..], without.pixels[first..]);
    }

    #[test]
    fn bits_do_not_depend_on_threads_or_on_pixels_out_of_reach() {
        let picture = |n: usize, noisy: &Noisy| {
            let pool = ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| denoise(noisy.clone(), &Denoise::default()))
        };
        let all =
            noisy(|_, _, i| noise(1.0, i), |_, _, i| Feature { depth: 3.0 + 0.01 * random(i, 3), ..wall(0, 0, 0) });
        let whole = picture(1, &all);
        for n in [2, 3, 7] {
            assert_eq!(picture(n, &all), whole, "{n} threads");
        }
        // The last columns are further than the reach from the first ones.
        let n_exact = SIDE - 1 - REACH;
        let cut = picture(2, &all.cropped([0, 0], [SIDE - 1, SIDE]));
        assert_eq!(cut.cropped([0, 0], [n_exact, SIDE]), whole.cropped([0, 0], [n_exact, SIDE]));
    }
}
