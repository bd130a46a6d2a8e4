//! Whether a scene needs the default light, and its strength.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_film::{Aov, Aovs, Film, srgb::luminance};
use canted_renderer::{Integrator, Prepared, Settings, render};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;

/// Longest side of the small pictures that decide, in pixels.
const PROBE_SIDE: u32 = 64;

/// The part of what is seen that emission must light so that the default light is not needed.
pub(super) const LIT_FRACTION: f64 = 0.5;

/// The part of the pixels with geometry that the emission of the scene lights visibly; 1 if nothing is seen.
///
/// Measured on a small path-traced picture: what counts is what the camera sees, not how much light there is.
pub(super) fn fraction_lit_by_emission<K: LaneKernel>(
    scene: &Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    [width, height]: [u32; 2],
) -> Result<f64> {
    let longest = width.max(height);
    let [width, height] =
        [width, height].map(|side| (u64::from(side) * u64::from(PROBE_SIDE) / u64::from(longest)).max(1));
    #[expect(clippy::cast_possible_truncation, reason = "at most 64")]
    let [width, height] = [width as u32, height as u32];
    let (integrator, aovs) = (Integrator::Path, Aovs::NONE.with(Aov::Depth));
    let probe = Settings { width, height, samples: 16, integrator, bounces: 4, aovs, ..Settings::default() };
    let film = render(scene, &prepared.structure, camera, &probe, &|_, _| {}, &AtomicBool::new(false))?;
    Ok(lit_fraction(&film))
}

/// The part of the pixels with geometry whose luminance is visible.
fn lit_fraction(film: &Film) -> f64 {
    /// Radiance that is an sRGB value of about 39.
    const VISIBLE: f64 = 0.02;
    let (mut n_seen, mut n_lit) = (0_u32, 0_u32);
    for (pixel, guide) in film.pixels().iter().zip(film.guides()) {
        if guide.n_hits > 0 {
            n_seen += 1;
            n_lit += u32::from(luminance(pixel.mean()) >= VISIBLE);
        }
    }
    if n_seen == 0 { 1.0 } else { f64::from(n_lit) / f64::from(n_seen) }
}

/// A warning about a picture that is nearly black. Where the film knows which pixels show geometry, the others do not count.
pub(super) fn darkness(film: &Film) -> Option<String> {
    /// Radiance of an sRGB value of about 10, and the part of all pixels.
    const BLACK: f64 = 0.003;
    const PART: f64 = 0.98;
    let guides = film.guides();
    let (mut n_seen, mut n_black) = (0_u64, 0_u64);
    for (i, color) in film.colors().enumerate() {
        if guides.get(i).is_none_or(|guide| guide.n_hits > 0) {
            n_seen += 1;
            n_black += u64::from(luminance(color.map(f64::from)) < BLACK);
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "pixels are fewer than 2^53")]
    let part = n_black as f64 / n_seen.max(1) as f64;
    (part > PART).then(|| {
        format!("{:.1} % of the picture are black; try --exposure auto, another light or another camera", 100.0 * part)
    })
}

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
    let [width, height] = [settings.width, settings.height].map(|side| side.min(PROBE_SIDE));
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
