//! The environment: light from infinitely far away, constant or an image; twin of `shared/light/environment.wgsl`.

use std::f64::consts::{PI, TAU};

#[cfg(feature = "gpu")]
use bytemuck::{Pod, Zeroable};
use canted_film::srgb::luminance;
use canted_scene::{Environment, EnvironmentImage};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::IncomingLight;
use crate::sampling::{cosine_hemisphere, tangents};
use crate::{Surface, narrow, wide};

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

    /// Samples a direction: by the cosine to the shading normal without a `sampler`, which is that of an image.
    #[inline]
    pub(super) fn sample(
        &self,
        sampler: Option<&SkySampler>,
        from: &Surface,
        square: [f32; 2],
    ) -> Option<IncomingLight> {
        let (to_light, density) = match sampler {
            Some(sampler) => sampler.sample(square),
            None => {
                let normal = DVec3::from(from.shading_normal);
                let [x, y, z] = cosine_hemisphere(square).map(f64::from);
                let [t, b] = tangents(normal);
                (t * x + (b * y + normal * z), z / PI)
            }
        };
        let direction = narrow(to_light);
        let radiance = wide(self.radiance(direction)) * (1.0 / density);
        Some(IncomingLight { to_light, radiance, density: Some(density), shadow_ray: Some(from.spawn_ray(direction)) })
    }

    /// PDF of [`Sky::sample`] per steradian.
    pub(super) fn density(sampler: Option<&SkySampler>, shading_normal: DVec3, direction: DVec3) -> f64 {
        match sampler {
            Some(sampler) => sampler.density(direction),
            None => shading_normal.dot(direction).max(0.0) / PI,
        }
    }

    /// Luminance of the irradiance on a surface that faces the mean radiance; 0 for an image without a `sampler`, which is black.
    pub(super) fn irradiance(&self, sampler: Option<&SkySampler>) -> f64 {
        let is_black = self.image().is_some() && sampler.is_none();
        PI * if is_black { 0.0 } else { super::luminance_of(self.mean) }
    }

    /// Irradiance on a surface with this unit normal, linear RGB: the sum over texels, each with the cosine of its center.
    pub(super) fn irradiance_on(&self, normal: DVec3) -> DVec3 {
        let image = match self.environment {
            Environment::Constant(radiance) => return PI * wide(*radiance),
            Environment::Image(image) => image,
        };
        let row = |row: usize| {
            let solid_angle = solid_angle(image, row);
            let cosine = 0.5 * (cosine_above(image, row) + cosine_above(image, row + 1));
            row_means(image, row).enumerate().fold(DVec3::ZERO, |sum, (column, radiance)| {
                let across = (column as f64 + 0.5) / f64::from(image.width);
                sum + radiance * (solid_angle * normal.dot(direction_of(image, across, cosine)).max(0.0))
            })
        };
        let rows: Vec<DVec3> = (0..image.height as usize).into_par_iter().map(row).collect();
        rows.into_iter().sum()
    }

    pub(super) fn image(&self) -> Option<&'a EnvironmentImage> {
        match self.environment {
            Environment::Constant(_) => None,
            Environment::Image(image) => Some(image),
        }
    }
}

/// Image coordinates of a direction, 0..=1 from the left and from the top.
fn coordinates_of(image: &EnvironmentImage, DVec3 { x, y, z }: DVec3) -> [f64; 2] {
    // Turning the image counter-clockwise moves a fixed direction to the right in it.
    let longitude = x.atan2(-z) + f64::from(image.turn_degrees).to_radians();
    let across = longitude / TAU + 0.5;
    // Squares of `f32` neither overflow nor vanish in `f64`.
    [across - whole(across), (x * x + z * z).sqrt().atan2(y) / PI]
}

/// The greatest integer that is not above `x`, which is small; without SSE 4.1, `floor` is a call.
fn whole(x: f64) -> f64 {
    let towards_zero = x as i64 as f64;
    if towards_zero > x { towards_zero - 1.0 } else { towards_zero }
}

/// The unit direction of a horizontal image coordinate and a cosine to +y.
fn direction_of(image: &EnvironmentImage, across: f64, cosine: f64) -> DVec3 {
    let (s, c) = ((across - 0.5) * TAU - f64::from(image.turn_degrees).to_radians()).sin_cos();
    let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
    DVec3::new(sine * s, cosine, -sine * c)
}

fn lookup(image: &EnvironmentImage, [across, down]: [f64; 2]) -> [f32; 3] {
    let (columns, x) = neighbors(across, image.width);
    let (rows, y) = neighbors(down, image.height);
    let (left, right) = (wrapped(columns[0], image.width), wrapped(columns[1], image.width));
    let blend = |a: Vec3, b: Vec3, weight: f32| a + weight * (b - a);
    let in_row = |row: i64| {
        let texels = &image.texels[clamped(row, image.height) * image.width as usize..][..image.width as usize];
        blend(texels[left].into(), texels[right].into(), x)
    };
    (blend(in_row(rows[0]), in_row(rows[1]), y) * Vec3::from(image.scale)).into()
}

/// The texels before and after a coordinate in 0..=1, and the weight of the second.
fn neighbors(coordinate: f64, n: u32) -> ([i64; 2], f32) {
    let texels = coordinate * f64::from(n) - 0.5;
    let first = whole(texels);
    ([first as i64, first as i64 + 1], (texels - first) as f32)
}

/// The index of a column at most one outside of the image, without a division.
fn wrapped(i: i64, n: u32) -> usize {
    let n = i64::from(n);
    (if i < 0 {
        i + n
    } else if i < n {
        i
    } else {
        i - n
    }) as usize
}

fn clamped(i: i64, n: u32) -> usize {
    i.clamp(0, i64::from(n) - 1) as usize
}

/// Solid angle of a texel of a row, in steradians.
fn solid_angle(image: &EnvironmentImage, row: usize) -> f64 {
    let [upper, lower] = [row, row + 1].map(|row| cosine_above(image, row));
    TAU / f64::from(image.width) * (upper - lower)
}

/// Cosine to +y of the upper edge of a row.
fn cosine_above(image: &EnvironmentImage, row: usize) -> f64 {
    (PI * row as f64 / f64::from(image.height)).cos()
}

/// Means over each texel of a row of the bilinear [`lookup`], uniform in longitude and latitude.
///
/// The mean of a piecewise linear function over a texel weights it and its neighbors by 3/4 and 1/8. It is zero only if
/// the function is zero over the entire texel.
fn row_means(image: &EnvironmentImage, row: usize) -> impl Iterator<Item = DVec3> {
    const WEIGHTS: [f64; 3] = [0.125, 0.75, 0.125];
    let width = image.width as usize;
    let column = move |i: usize| -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (weight, j) in WEIGHTS.into_iter().zip([row.saturating_sub(1), row, row + 1]) {
            let texel = image.texels[j.min(image.height as usize - 1) * width + i];
            sum += weight * wide(texel) * wide(image.scale);
        }
        sum
    };
    (0..width).map(move |i| {
        let [a, b, c] = [(i + width - 1) % width, i, (i + 1) % width].map(column);
        WEIGHTS[0] * a + WEIGHTS[1] * b + WEIGHTS[2] * c
    })
}

fn mean_of(image: &EnvironmentImage) -> [f32; 3] {
    let rows: Vec<DVec3> = (0..image.height as usize)
        .into_par_iter()
        .map(|row| {
            let fraction = solid_angle(image, row) / (4.0 * PI);
            row_means(image, row).fold(DVec3::ZERO, |sum, texel| sum + fraction * texel)
        })
        .collect();
    narrow(rows.iter().fold(DVec3::ZERO, |sum, row| sum + *row))
}

/// Importance sampling of an [`EnvironmentImage`].
///
/// Chooses a texel by mean luminance times solid angle, then a uniform direction in it. The PDF is constant over a
/// texel and positive wherever the bilinear radiance is.
pub(crate) struct SkySampler<'a> {
    image: &'a EnvironmentImage,
    /// Running sums within each row, starting with 0.
    within_rows: Vec<f64>,
    /// Running sums over rows, starting with 0.
    rows: Vec<f64>,
    /// Where [`invert`] starts in `rows`, and in each row of `within_rows`: half as much memory as the sums.
    row_guide: Vec<u32>,
    column_guides: Vec<u32>,
    /// Cosines of the upper edges of rows, and of the lower edge of the last.
    cosines: Vec<f64>,
    /// For each row, the sum of all texels times the solid angle of one.
    scales: Vec<f64>,
}

impl<'a> SkySampler<'a> {
    /// `None` for a black image, or if the sum is not finite.
    pub(super) fn new(image: &'a EnvironmentImage) -> Option<Self> {
        let row = |row: usize| {
            let solid_angle = solid_angle(image, row);
            let weights = row_means(image, row).map(|mean| solid_angle * luminance(mean.into()));
            running_sums(weights).collect::<Vec<f64>>()
        };
        let within_rows: Vec<Vec<f64>> = (0..image.height as usize).into_par_iter().map(row).collect();
        let totals = within_rows.iter().map(|row| row.last().copied().unwrap_or(0.0));
        let rows: Vec<f64> = running_sums(totals).collect();
        let total = *rows.last()?;
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let column_guides = within_rows.par_iter().flat_map_iter(|sums| guide(sums)).collect();
        let cosines = (0..=image.height as usize).map(|row| cosine_above(image, row)).collect();
        let scales = (0..image.height as usize).map(|row| total * solid_angle(image, row)).collect();
        let (row_guide, within_rows) = (guide(&rows), within_rows.concat());
        Some(Self { image, within_rows, rows, row_guide, column_guides, cosines, scales })
    }

    /// Samples a unit direction, with its PDF per steradian.
    fn sample(&self, square: [f32; 2]) -> (DVec3, f64) {
        let (row, down) = invert(&self.rows, &self.row_guide, square[1].into());
        let width = self.image.width as usize;
        let guide = &self.column_guides[row * width..(row + 1) * width];
        let (column, across) = invert(self.row(row), guide, square[0].into());
        let (upper, lower) = (self.cosines[row], self.cosines[row + 1]);
        let across = (column as f64 + across) / f64::from(self.image.width);
        let direction = direction_of(self.image, across, upper + down * (lower - upper));
        (direction, self.density_at(row, column))
    }

    /// PDF of a direction per steradian.
    fn density(&self, direction: DVec3) -> f64 {
        let [across, down] = coordinates_of(self.image, direction);
        let index = |x: f64, n: u32| {
            let index = (x * f64::from(n)) as usize;
            index.min(n as usize - 1)
        };
        self.density_at(index(down, self.image.height), index(across, self.image.width))
    }

    fn density_at(&self, row: usize, column: usize) -> f64 {
        let sums = self.row(row);
        (sums[column + 1] - sums[column]) / self.scales[row]
    }

    fn row(&self, row: usize) -> &[f64] {
        let n = self.image.width as usize + 1;
        &self.within_rows[row * n..(row + 1) * n]
    }
}

/// An environment map: `SkyImage` of `shared/light/environment`.
#[cfg(feature = "gpu")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct SkyImage {
    pub(crate) scale: [f32; 3],
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) turn: f32,
    pub(crate) padding: [u32; 2],
}

/// The distribution over rows of the environment map: `SkyRow` of `shared/light/environment`.
#[cfg(feature = "gpu")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct SkyRow {
    pub(crate) sum: f32,
    pub(crate) cosine: f32,
    pub(crate) per_steradian: f32,
}

#[cfg(feature = "gpu")]
impl SkyImage {
    /// An environment map without its texels.
    pub(crate) fn new(image: &EnvironmentImage) -> Self {
        Self {
            scale: super::bounded(image.scale),
            width: image.width,
            height: image.height,
            turn: (f64::from(image.turn_degrees) / 360.0).rem_euclid(1.0) as f32,
            padding: [0; 2],
        }
    }
}

#[cfg(feature = "gpu")]
impl SkySampler<'_> {
    /// The rows, and the running sums of each row, normalized. A black row is never chosen.
    pub(crate) fn packed(&self) -> (Vec<SkyRow>, Vec<f32>) {
        let total = self.rows[self.rows.len() - 1];
        let row = |(number, sum): (usize, &f64)| SkyRow {
            sum: (sum / total) as f32,
            cosine: cosine_above(self.image, number) as f32,
            per_steradian: (1.0 / solid_angle(self.image, number)) as f32,
        };
        let sums = (0..self.rows.len() - 1).flat_map(|row| {
            let sums = self.row(row);
            let total = sums[sums.len() - 1];
            sums.iter().map(move |sum| if total > 0.0 { (sum / total) as f32 } else { 0.0 })
        });
        (self.rows.iter().enumerate().map(row).collect(), sums.collect())
    }
}

fn running_sums(values: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let mut sum = 0.0;
    std::iter::once(0.0).chain(values.map(move |value| {
        sum += value;
        sum
    }))
}

/// For each of as many equal parts of a distribution as it has intervals, the index of the first sum above its start.
fn guide(sums: &[f64]) -> Vec<u32> {
    let n = sums.len() - 1;
    let mut after = 0;
    let first_above = |part: usize| {
        let start = part as f64 / n as f64 * sums[n];
        while after < n && sums[after] <= start {
            after += 1;
        }
        after as u32
    };
    (0..n).map(first_above).collect()
}

/// Inverts a piecewise constant distribution: the interval of `u` times the total, and the relative position in it. `guide` is that of the
/// sums (Chen and Asau 1974), so that most searches end after a step or two.
///
/// Intervals of zero width are never chosen, because `u` is below 1.
fn invert(sums: &[f64], guide: &[u32], u: f64) -> (usize, f64) {
    let n = guide.len();
    let target = u * sums[n];
    let part = ((u * n as f64) as usize).min(n - 1);
    let mut after = guide[part] as usize;
    // The part may be off by one through rounding.
    while after > 1 && sums[after - 1] > target {
        after -= 1;
    }
    while after < n && sums[after] <= target {
        after += 1;
    }
    let after = after.max(1);
    let (low, high) = (sums[after - 1], sums[after]);
    (after - 1, (target - low) / (high - low))
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    #[test]
    fn guided_searches_find_what_a_search_of_all_finds() {
        let mut rng = SplitMix64::new(3);
        for round in 0..200 {
            let n = 1 + round % 70;
            let weights =
                (0..n).map(|i| if (i + round) % 3 == 0 { 0.0 } else { rng.unit().powi(1 + round as i32 % 40) });
            let sums: Vec<f64> = running_sums(weights).collect();
            if sums[n] == 0.0 {
                continue;
            }
            let guide = guide(&sums);
            for i in 0..500 {
                let u = if i < 100 { i as f64 / 100.0 } else { f64::from(rng.unit() as f32).min(1.0 - f64::EPSILON) };
                let target = u * sums[n];
                let after = sums.partition_point(|&sum| sum <= target).clamp(1, n);
                let (interval, position) = invert(&sums, &guide, u);
                assert_eq!(interval, after - 1, "{round} {u}");
                assert!((0.0..=1.0).contains(&position));
            }
        }
    }
}
