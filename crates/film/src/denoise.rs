//! Removes the noise of few samples from a picture.
//!
//! ```text
//! reads   mean and variance of each pixel; albedo, shading normal and depth of its first hits
//! writes  a picture
//! stages  demodulate (noisy) -> estimate variance (variance) -> filter level by level (wavelet) -> modulate
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

mod noisy;
mod variance;
mod wavelet;

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::Picture;
pub use noisy::Noisy;
use noisy::{Feature, Light};

/// Levels of the filter; level `i` has steps of `2^i` pixels.
const LEVELS: u32 = 5;

/// Greatest distance, in pixels along an axis, at which a pixel affects another one.
///
/// Each level reaches two steps and its 3 x 3 variance one pixel more; the estimate of the variance reaches
/// three pixels and the slope of the depth one.
pub const REACH: u32 = 2 * ((1 << LEVELS) - 1) + LEVELS + variance::RADIUS + 1;

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
    variance::estimate(&mut light, &features, size, config);
    let means: Vec<[f32; 3]> = light.iter().map(|light| light.color).collect();
    let mut next = light.clone();
    for level in 0..LEVELS {
        wavelet::level(&light, &features, &mut next, size, 1 << level, config);
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
