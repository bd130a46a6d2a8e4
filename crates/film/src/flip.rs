//! FLIP: the difference that a viewer perceives when alternating between two pictures, from 0 to 1 per pixel.
//!
//! ```text
//! linear RGB -> opponent colors -> contrast sensitivity filters -> color difference \
//!            -> luma -> edges, points                           -> feature difference -> error
//! ```
//!
//! Andersson et al., FLIP: A Difference Evaluator for Alternating Images, HPG 2020; Andersson et al., Visualizing Errors
//! in Rendered High Dynamic Range Images, Eurographics Short Papers 2021. All constants are theirs.

mod color;
mod exposure;
mod features;
mod filter;

use rayon::prelude::*;

use crate::compare::{self, CompareError};
use crate::{Picture, colormap};

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
        #[expect(clippy::cast_precision_loss, reason = "pixels are fewer than 2^53")]
        let n = finite.clone().count() as f64;
        finite.sum::<f64>() / n
    }

    /// The errors in false color, from dark to yellow; magenta where there is no error.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let color = |error: &Option<f64>| error.map_or([1.0, 0.0, 1.0], colormap::viridis);
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
    for exposure in exposure::exposures(&planes[1].values) {
        let shown = planes.clone().map(|plane| plane.map(|pixel| exposure::tone_mapped(pixel, exposure)));
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
    let opponent = planes.each_ref().map(|plane| plane.map(color::opponent));
    let perceived = opponent.each_ref().map(|plane| color::perceived(plane, pixels_per_degree));
    let features = opponent.each_ref().map(|plane| features::features(plane, pixels_per_degree));
    let n = planes[0].values.len();
    (0..n)
        .into_par_iter()
        .map(|i| {
            let color = color::difference(perceived[0].values[i], perceived[1].values[i]);
            let feature = features::difference(features[0].values[i], features[1].values[i]);
            color.powf(1.0 - feature)
        })
        .collect()
}

#[cfg(test)]
mod tests;
