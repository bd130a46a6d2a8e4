//! Strength of the default light.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_film::Aovs;
use canted_renderer::{Prepared, Settings, render};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;

/// The factor for the default light that gives a well exposed picture: interiors lit through openings need more than 1.
///
/// Measured on a small picture, because radiance is proportional to the light.
pub(super) fn default_light_strength<K: LaneKernel>(
    scene: &Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    settings: &Settings,
) -> Result<f32> {
    /// Mean radiance of a well exposed picture.
    const MEAN: f64 = 0.3;
    const LIMITS: (f64, f64) = (1.0, 32.0);
    let [width, height] = [settings.width, settings.height].map(|side| side.min(64));
    // Independent of the sample range, so that all parts of a picture have the same light.
    let (samples, part, noise, aovs) = (16, None, None, Aovs::NONE);
    let probe = Settings { width, height, samples, part, noise, aovs, ..*settings };
    // Not cancellable: before there is a partial result, a signal ends the process.
    let film = render(scene, &prepared.structure, camera, &probe, &|_, _| {}, &AtomicBool::new(false))?;
    let sum: f64 = film.pixels().iter().flat_map(|pixel| pixel.mean()).sum();
    let mean = sum / f64::from(3 * width * height);
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    let strength = (MEAN / mean.max(f64::MIN_POSITIVE)).clamp(LIMITS.0, LIMITS.1) as f32;
    Ok(strength)
}
