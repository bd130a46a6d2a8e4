//! Small pictures that decide: whether emission lights a scene, the strength of its light, the exposure; and whether a picture is dark.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use canted_film::{Aov, Aovs, Film, srgb::luminance};
use canted_renderer::{Integrator, Lod, MipMaps, Monitor, SceneBvh, Settings, Surfaces, render, resume_with};
use canted_scene::{Camera, Scene};

/// Longest side of the small pictures that decide, in pixels.
const PROBE_SIDE: u32 = 64;

/// What emission does for the surfaces that a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lit {
    /// The part of the surfaces that reflect and do not emit themselves which the emission of others lights visibly; 0 without any.
    pub(super) part: f64,
    /// The part of all surfaces that reflect.
    pub(super) reflecting: f64,
}

/// Measures what emission lights, on small path-traced pictures: what counts is what the camera sees, not how much light there is. What emits
/// itself does not count, so that a label or a screen is no lamp.
pub(super) fn lit_by_emission(
    scene: &Scene,
    bvh: &SceneBvh,
    camera: &Camera,
    [width, height]: [u32; 2],
) -> Result<Lit> {
    let longest = width.max(height);
    let [width, height] =
        [width, height].map(|side| (u64::from(side) * u64::from(PROBE_SIDE) / u64::from(longest)).max(1));
    let [width, height] = [width as u32, height as u32];
    let (integrator, aovs) = (Integrator::Path, Aovs::NONE.with(Aov::Depth).with(Aov::Albedo));
    let probe = Settings { width, height, samples: 16, integrator, aovs, ..Settings::default() };
    let film =
        |bounces| render(scene, bvh, camera, &Settings { bounces, ..probe }, &|_, _| {}, &AtomicBool::new(false));
    // Without bounces a path sees the emission of its first surface alone, and both have the same camera rays.
    Ok(lit(&film(4)?, &film(0)?))
}

/// The parts by a picture of all light, and one of the emission that is seen directly.
fn lit(all: &Film, direct: &Film) -> Lit {
    /// Radiance of an sRGB value of about 39, relative to that of a white surface.
    const VISIBLE: f64 = 0.02;
    /// Darker surfaces show no light.
    const REFLECTING: f64 = 0.02;
    let (mut n_seen, mut n_reflecting, mut n_dull, mut n_lit) = (0_u32, 0_u32, 0_u32, 0_u32);
    for ((all, direct), guide) in all.pixels().iter().zip(direct.pixels()).zip(all.guides()) {
        if guide.n_hits == 0 {
            continue;
        }
        n_seen += 1;
        let albedo = luminance(guide.albedo) / f64::from(guide.n_hits);
        if albedo < REFLECTING {
            continue;
        }
        n_reflecting += 1;
        let emitted = luminance(direct.mean());
        if emitted < VISIBLE {
            n_dull += 1;
            n_lit += u32::from(luminance(all.mean()) - emitted >= VISIBLE * albedo.max(0.2));
        }
    }
    let part = |n: u32, of: u32| f64::from(n) / f64::from(of.max(1));
    let reflecting = if n_seen == 0 { 1.0 } else { part(n_reflecting, n_seen) };
    Lit { part: part(n_lit, n_dull), reflecting }
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
    let part = n_black as f64 / n_seen.max(1) as f64;
    (part > PART).then(|| {
        format!("{:.1} % of the picture are black; try --exposure auto, another light or another camera", 100.0 * part)
    })
}

/// The factor for the default light that gives a well exposed picture: interiors lit through openings need more than 1, and white
/// surfaces in the sun less.
///
/// Measured on a small picture, because radiance is proportional to the light.
pub(super) fn default_light_strength(
    scene: &Scene,
    bvh: &SceneBvh,
    camera: &Camera,
    settings: &Settings,
    mip_maps: &mut Option<MipMaps>,
) -> Result<f32> {
    /// Mean radiance of a well exposed picture.
    const MEAN: f64 = 0.3;
    /// A white diffuse surface that faces the sun of the sky of strength 1 is brighter than white.
    const LIMITS: (f64, f64) = (0.84, 32.0);
    /// Part of the pixels with geometry that may be as bright as white or brighter.
    const CLIPPED: f64 = 0.05;
    let film = probe(scene, bvh, camera, settings, mip_maps)?;
    let sum: f64 = film.pixels().iter().flat_map(|pixel| pixel.mean()).sum();
    let mean = sum / (3 * film.pixels().len()) as f64;
    let bright = quantile(&seen(&film, |[r, g, b]| r.max(g).max(b)), 1.0 - CLIPPED);
    // A dark interior keeps bright openings.
    let least = (1.0 / bright.max(f64::MIN_POSITIVE)).clamp(LIMITS.0, 1.0);
    let strength = (MEAN / mean.max(f64::MIN_POSITIVE)).clamp(least, LIMITS.1) as f32;
    Ok(strength)
}

/// Stops that show what the lights of the scene light: where most of it would be white or black; else `None`.
pub(super) fn needed_stops(
    scene: &Scene,
    bvh: &SceneBvh,
    camera: &Camera,
    settings: &Settings,
    mip_maps: &mut Option<MipMaps>,
) -> Result<Option<f32>> {
    /// Bright and dark luminances, and the parts of the geometry that need stops where they are beyond.
    const WHITE: f64 = 1.0;
    const BLACK: f64 = 0.02;
    const PART: f64 = 0.3;
    /// Luminance that a tenth of the geometry exceeds, afterwards.
    const BRIGHT: f64 = 0.8;
    const LIMIT: f32 = 20.0;
    let all = seen(&probe(scene, bvh, camera, settings, mip_maps)?, luminance);
    let bright = quantile(&all, 0.9);
    // Where nothing is lit, no exposure shows it.
    if bright <= 0.0 || quantile(&all, 1.0 - PART) < WHITE && bright > BLACK {
        return Ok(None);
    }
    let stops = ((BRIGHT / bright).log2() as f32).clamp(-LIMIT, LIMIT);
    // Tenths are what people give.
    Ok(Some((10.0 * stops).round() / 10.0))
}

/// A small picture with the depth of geometry. It does not depend on the sample range, so that all parts of a picture agree. Uses and
/// keeps mip
/// maps, which may take longer than the picture.
fn probe(
    scene: &Scene,
    bvh: &SceneBvh,
    camera: &Camera,
    settings: &Settings,
    mip_maps: &mut Option<MipMaps>,
) -> Result<Film> {
    let [width, height] = [settings.width, settings.height].map(|side| side.min(PROBE_SIDE));
    let (samples, part, noise, aovs) = (16, None, None, Aovs::NONE.with(Aov::Depth));
    let probe = Settings { width, height, samples, part, noise, aovs, ..*settings };
    // Not cancellable: before there is a partial result, a signal ends the process.
    let surfaces = surfaces(scene, probe.lod, mip_maps);
    Ok(resume_with(&surfaces, bvh, camera, &probe, vec![], &Monitor::quiet(&AtomicBool::new(false)))?)
}

/// The surfaces of a scene with the mip maps that are known, which it keeps.
pub(super) fn surfaces<'a>(scene: &'a Scene, lod: Lod, mip_maps: &mut Option<MipMaps>) -> Surfaces<'a> {
    let surfaces = match mip_maps {
        Some(known) => Surfaces::with_mip_maps(scene, lod, known),
        None => Surfaces::with_lod(scene, lod),
    };
    *mip_maps = Some(surfaces.mip_maps());
    surfaces
}

/// A value of each pixel that shows geometry, ascending.
fn seen(film: &Film, value: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
    let pixels = film.pixels().iter().zip(film.guides()).filter(|(_, guide)| guide.n_hits > 0);
    let mut values: Vec<f64> = pixels.map(|(pixel, _)| value(pixel.mean())).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The value that a part of ascending values does not exceed; 0 without values.
fn quantile(values: &[f64], part: f64) -> f64 {
    let index = (part * values.len() as f64) as usize;
    values.get(index.min(values.len().saturating_sub(1))).copied().unwrap_or(0.0)
}
