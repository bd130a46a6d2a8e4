use std::f64::consts::{PI, TAU};

use canted_film::srgb::luminance;
use canted_scene::{Environment, EnvironmentImage};
use rayon::prelude::*;

use crate::vector::{Vector, wide};

/// The environment, prepared for lookups.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sky<'a> {
    environment: &'a Environment,
    /// Mean over all directions, linear RGB.
    pub(super) mean: [f32; 3],
}

impl<'a> Sky<'a> {
    pub(super) fn new(environment: &'a Environment) -> Self {
        let mean = match environment {
            Environment::Constant(radiance) => *radiance,
            Environment::Image(image) => mean_of(image),
        };
        Self { environment, mean }
    }

    /// Radiance from a direction of any length, linear RGB.
    ///
    /// Bilinear interpolation in longitude and latitude. Longitude wraps around; latitude is clamped to the first and
    /// last row.
    pub(super) fn radiance(&self, direction: [f32; 3]) -> [f32; 3] {
        match self.environment {
            Environment::Constant(radiance) => *radiance,
            Environment::Image(image) => lookup(image, coordinates_of(image, wide(direction))),
        }
    }

    pub(super) fn image(&self) -> Option<&'a EnvironmentImage> {
        match self.environment {
            Environment::Constant(_) => None,
            Environment::Image(image) => Some(image),
        }
    }
}

/// Image coordinates of a direction, 0..=1 from the left and from the top.
pub(super) fn coordinates_of(image: &EnvironmentImage, [x, y, z]: Vector) -> [f64; 2] {
    // Turning the image counter-clockwise moves a fixed direction to the right in it.
    let longitude = x.atan2(-z) + f64::from(image.turn_degrees).to_radians();
    let across = longitude / TAU + 0.5;
    [across - across.floor(), x.hypot(z).atan2(y) / PI]
}

/// The unit direction of a horizontal image coordinate and a cosine to +y.
pub(super) fn direction_of(image: &EnvironmentImage, across: f64, cosine: f64) -> Vector {
    let (s, c) = ((across - 0.5) * TAU - f64::from(image.turn_degrees).to_radians()).sin_cos();
    let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
    [sine * s, cosine, -sine * c]
}

fn lookup(image: &EnvironmentImage, [across, down]: [f64; 2]) -> [f32; 3] {
    let (columns, x) = neighbors(across, image.width);
    let (rows, y) = neighbors(down, image.height);
    let [left, right] = columns.map(|i| wrapped(i, image.width));
    let [top, bottom] = rows.map(|j| clamped(j, image.height));
    let texel = |row: usize, column: usize| image.texels[row * image.width as usize + column];
    let blend = |a: [f32; 3], b: [f32; 3], weight: f32| std::array::from_fn(|k| a[k] + weight * (b[k] - a[k]));
    let [upper, lower] = [top, bottom].map(|row| blend(texel(row, left), texel(row, right), x));
    let radiance: [f32; 3] = blend(upper, lower, y);
    std::array::from_fn(|k| radiance[k] * image.scale[k])
}

/// The texels before and after a coordinate in 0..=1, and the weight of the second.
#[expect(clippy::cast_possible_truncation, reason = "the coordinate lies in 0..=1")]
fn neighbors(coordinate: f64, n: u32) -> ([i64; 2], f32) {
    let texels = coordinate * f64::from(n) - 0.5;
    let first = texels.floor();
    ([first as i64, first as i64 + 1], (texels - first) as f32)
}

#[expect(clippy::cast_possible_truncation, reason = "the result lies in 0..n")]
fn wrapped(i: i64, n: u32) -> usize {
    i.rem_euclid(n.into()) as usize
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the result lies in 0..n")]
fn clamped(i: i64, n: u32) -> usize {
    i.clamp(0, i64::from(n) - 1) as usize
}

/// Solid angle of a texel of a row, in steradians.
pub(super) fn solid_angle(image: &EnvironmentImage, row: usize) -> f64 {
    let [upper, lower] = [row, row + 1].map(|row| cosine_above(image, row));
    TAU / f64::from(image.width) * (upper - lower)
}

/// Cosine to +y of the upper edge of a row.
#[expect(clippy::cast_precision_loss, reason = "rows are counted in 32 bits")]
pub(super) fn cosine_above(image: &EnvironmentImage, row: usize) -> f64 {
    (PI * row as f64 / f64::from(image.height)).cos()
}

/// Means over each texel of a row of the bilinear [`lookup`], uniform in longitude and latitude.
///
/// The mean of a piecewise linear function over a texel weights it and its neighbors by 3/4 and 1/8. It is zero only if
/// the function is zero over the entire texel.
pub(super) fn row_means(image: &EnvironmentImage, row: usize) -> impl Iterator<Item = Vector> {
    const WEIGHTS: [f64; 3] = [0.125, 0.75, 0.125];
    let width = image.width as usize;
    let column = move |i: usize| -> Vector {
        let mut sum = [0.0; 3];
        for (weight, j) in WEIGHTS.into_iter().zip([row.saturating_sub(1), row, row + 1]) {
            let texel = image.texels[j.min(image.height as usize - 1) * width + i];
            sum = std::array::from_fn(|k| sum[k] + weight * f64::from(texel[k]) * f64::from(image.scale[k]));
        }
        sum
    };
    (0..width).map(move |i| {
        let [a, b, c] = [(i + width - 1) % width, i, (i + 1) % width].map(column);
        std::array::from_fn(|k| WEIGHTS[0] * a[k] + WEIGHTS[1] * b[k] + WEIGHTS[2] * c[k])
    })
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn mean_of(image: &EnvironmentImage) -> [f32; 3] {
    let rows: Vec<Vector> = (0..image.height as usize)
        .into_par_iter()
        .map(|row| {
            let fraction = solid_angle(image, row) / (4.0 * PI);
            row_means(image, row).fold([0.0; 3], |sum, texel| std::array::from_fn(|k| sum[k] + fraction * texel[k]))
        })
        .collect();
    let mean: Vector = rows.iter().fold([0.0; 3], |sum, row| std::array::from_fn(|k| sum[k] + row[k]));
    mean.map(|x| x as f32)
}

/// Importance sampling of an [`EnvironmentImage`].
///
/// Chooses a texel by mean luminance times solid angle, then a uniform direction in it. The PDF is constant over a
/// texel and positive wherever the bilinear radiance is.
pub(super) struct SkySampler<'a> {
    pub(super) image: &'a EnvironmentImage,
    /// Running sums within each row, starting with 0.
    within_rows: Vec<f64>,
    /// Running sums over rows, starting with 0.
    pub(super) rows: Vec<f64>,
}

impl<'a> SkySampler<'a> {
    /// `None` for a black image, or if the sum is not finite.
    pub(super) fn new(image: &'a EnvironmentImage) -> Option<Self> {
        let row = |row: usize| {
            let solid_angle = solid_angle(image, row);
            let weights = row_means(image, row).map(|mean| solid_angle * luminance(mean));
            running_sums(weights).collect::<Vec<f64>>()
        };
        let within_rows: Vec<Vec<f64>> = (0..image.height as usize).into_par_iter().map(row).collect();
        let totals = within_rows.iter().map(|row| row.last().copied().unwrap_or(0.0));
        let rows: Vec<f64> = running_sums(totals).collect();
        let total = *rows.last()?;
        (total > 0.0 && total.is_finite()).then(|| Self { image, within_rows: within_rows.concat(), rows })
    }

    /// Samples a unit direction, with its PDF per steradian.
    pub(super) fn sample(&self, square: [f32; 2]) -> (Vector, f64) {
        let (row, down) = invert(&self.rows, square[1].into());
        let sums = self.row(row);
        let (column, across) = invert(sums, square[0].into());
        let [upper, lower] = [row, row + 1].map(|row| cosine_above(self.image, row));
        #[expect(clippy::cast_precision_loss, reason = "columns are counted in 32 bits")]
        let across = (column as f64 + across) / f64::from(self.image.width);
        let direction = direction_of(self.image, across, upper + down * (lower - upper));
        (direction, self.density_at(row, column))
    }

    /// PDF of a direction per steradian.
    pub(super) fn density(&self, direction: Vector) -> f64 {
        let [across, down] = coordinates_of(self.image, direction);
        let index = |x: f64, n: u32| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=1 times n")]
            let index = (x * f64::from(n)) as usize;
            index.min(n as usize - 1)
        };
        self.density_at(index(down, self.image.height), index(across, self.image.width))
    }

    fn density_at(&self, row: usize, column: usize) -> f64 {
        let sums = self.row(row);
        let total = self.rows[self.rows.len() - 1];
        (sums[column + 1] - sums[column]) / (total * solid_angle(self.image, row))
    }

    pub(super) fn row(&self, row: usize) -> &[f64] {
        let n = self.image.width as usize + 1;
        &self.within_rows[row * n..(row + 1) * n]
    }
}

fn running_sums(values: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let mut sum = 0.0;
    std::iter::once(0.0).chain(values.map(move |value| {
        sum += value;
        sum
    }))
}

/// Inverts a piecewise constant distribution: the interval of `u` times the total, and the relative position in it.
///
/// Intervals of zero width are never chosen, because `u` is below 1.
fn invert(sums: &[f64], u: f64) -> (usize, f64) {
    let target = u * sums[sums.len() - 1];
    let after = sums.partition_point(|&sum| sum <= target).clamp(1, sums.len() - 1);
    let (low, high) = (sums[after - 1], sums[after]);
    (after - 1, (target - low) / (high - low))
}
