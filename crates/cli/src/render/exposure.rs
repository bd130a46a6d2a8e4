//! How strong our own light is, where a scene brings none.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_film::Aovs;
use canted_renderer::{Prepared, Settings, render};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;

/// By how much our own light must be stronger for a picture that is not dark, as interiors lit by a sky are.
///
/// A small picture tells; light only scales it.
pub(super) fn strength_of_default_light<K: LaneKernel>(
    scene: &Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    settings: &Settings,
) -> Result<f32> {
    /// Mean radiance of a well exposed picture, and the least and greatest strength.
    const MEAN: f64 = 0.3;
    const LIMITS: (f64, f64) = (1.0, 32.0);
    let [width, height] = [settings.width, settings.height].map(|side| side.min(64));
    // The same for every part of the samples.
    let (samples, part, noise, aovs) = (16, None, None, Aovs::NONE);
    let probe = Settings { width, height, samples, part, noise, aovs, ..*settings };
    // Nobody stops it: as long as there is nothing to keep, a signal ends the process.
    let film = render(scene, &prepared.structure, camera, &probe, &|_, _| {}, &AtomicBool::new(false))?;
    let sum: f64 = film.pixels().iter().flat_map(|pixel| pixel.mean()).sum();
    let mean = sum / f64::from(3 * width * height);
    #[expect(clippy::cast_possible_truncation, reason = "a factor of light")]
    let strength = (MEAN / mean.max(f64::MIN_POSITIVE)).clamp(LIMITS.0, LIMITS.1) as f32;
    Ok(strength)
}
