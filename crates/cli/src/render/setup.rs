//! What rendering starts from: the built scene, the camera, the integrator and the light. Small pictures decide whether a scene needs the
//! default light, its strength, and the exposure for other light.

use std::sync::atomic::AtomicBool;

use anyhow::{Result, anyhow};
use canted_film::{Aov, Aovs, Film, srgb::luminance};
use canted_renderer::{Integrator, SceneBvh, Settings, render};
use canted_scene::{Camera, Scene};

use crate::{
    light::{self, LightSource},
    load, output,
    settings::Plan,
};

/// A scene ready to render.
pub(crate) struct Setup {
    pub(crate) bvh: SceneBvh,
    pub(crate) camera: Camera,
    pub(crate) choice: Choice,
}

/// What was decided for a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// Strength of the default light, if it is used.
    pub(crate) default_light: Option<f32>,
    /// The exposure in stops, where one was chosen other than 0.
    pub(crate) exposure: Option<f32>,
    /// Why the integrator was chosen.
    pub(crate) integrator_reason: &'static str,
}

/// Builds the scene, and chooses camera, light and integrator, which it sets in `plan`.
pub(crate) fn setup(scene: &mut Scene, plan: &mut Plan, source: LightSource) -> Result<Setup> {
    let name = load::name(plan.source.scene.as_deref());
    let config = plan.structure.config_for(scene);
    let mut bvh = SceneBvh::build(scene, &config).map_err(|error| anyhow!("{name}: {error}"))?;
    let camera = plan.camera(scene, &bvh)?;
    let source = decided(scene, &mut bvh, &camera, plan, source)?;
    let choice = choose(scene, &bvh, &camera, plan, source)?;
    Ok(Setup { bvh, camera, choice })
}

/// Whether emission alone lights the scene, decided by a small picture; if not, adds the default light and reports it.
pub(crate) fn decided(
    scene: &mut Scene,
    bvh: &mut SceneBvh,
    camera: &Camera,
    plan: &Plan,
    source: LightSource,
) -> Result<LightSource> {
    if source != LightSource::Emission || plan.heatmap.is_some() {
        return Ok(source);
    }
    let lit = fraction_lit_by_emission(scene, bvh, camera, plan.size())?;
    if lit >= LIT_FRACTION {
        return Ok(source);
    }
    output::note(&format!(
        "added the default light: the scene's own emission lights {:.0} % of what is seen; --env 0,0,0 renders without",
        100.0 * lit
    ));
    light::set_default(scene, 1.0, plan.up());
    // They were listed before there was a light.
    bvh.unused.retain(|unused| !["listed lights", "light selection"].contains(&unused.feature));
    Ok(LightSource::Default)
}

/// Chooses the integrator, and scales the default light if it is used.
pub(crate) fn choose(
    scene: &mut Scene,
    bvh: &SceneBvh,
    camera: &Camera,
    plan: &mut Plan,
    source: LightSource,
) -> Result<Choice> {
    let is_free = plan.integrator.is_none();
    let mut integrator_reason = plan.choose_integrator(scene, source == LightSource::Emission);
    if source != LightSource::Default || plan.heatmap.is_some() {
        let is_exposed = source != LightSource::Default && plan.needs_exposure();
        let exposure = if is_exposed { expose(scene, bvh, camera, plan)? } else { None };
        return Ok(Choice { default_light: None, exposure, integrator_reason });
    }
    light::set_default(scene, 1.0, plan.up());
    let mut strength = default_light_strength(scene, bvh, camera, &plan.settings)?;
    if is_free && plan.integrator == Some(Integrator::Path) && strength > MAX_PATH_STRENGTH {
        plan.choose(Integrator::Hybrid);
        integrator_reason = "little of the default light gets in";
        strength = default_light_strength(scene, bvh, camera, &plan.settings)?;
    }
    light::set_default(scene, strength, plan.up());
    Ok(Choice { default_light: Some(strength), exposure: None, integrator_reason })
}

/// A room that needs the default light stronger than this is dark and noisy by `path`: nearly all light comes through small openings.
/// The ambient light of `hybrid` shows it.
const MAX_PATH_STRENGTH: f32 = 3.0;

/// Sets the exposure where the lights of the file would give a white or a black picture, reports it, and returns it.
fn expose(scene: &Scene, bvh: &SceneBvh, camera: &Camera, plan: &mut Plan) -> Result<Option<f32>> {
    let stops = needed_stops(scene, bvh, camera, &plan.settings)?;
    if let Some(stops) = stops {
        let what = if stops < 0.0 { "white" } else { "black" };
        output::note(&format!(
            "--exposure {stops}: the lights of the file would leave most of the picture {what}; --exposure 0 keeps them as they are"
        ));
    }
    // Also decides for later pictures of a sequence, which must not flicker.
    plan.look.set_stops(Some(stops.unwrap_or(0.0)));
    Ok(stops)
}

/// Longest side of the small pictures that decide, in pixels.
const PROBE_SIDE: u32 = 64;

/// The part of what is seen that emission must light so that the default light is not needed.
const LIT_FRACTION: f64 = 0.5;

/// The part of the pixels with geometry that the emission of the scene lights visibly; 1 if nothing is seen.
///
/// Measured on a small path-traced picture: what counts is what the camera sees, not how much light there is.
fn fraction_lit_by_emission(scene: &Scene, bvh: &SceneBvh, camera: &Camera, [width, height]: [u32; 2]) -> Result<f64> {
    let longest = width.max(height);
    let [width, height] =
        [width, height].map(|side| (u64::from(side) * u64::from(PROBE_SIDE) / u64::from(longest)).max(1));
    let [width, height] = [width as u32, height as u32];
    let (integrator, aovs) = (Integrator::Path, Aovs::NONE.with(Aov::Depth));
    let probe = Settings { width, height, samples: 16, integrator, bounces: 4, aovs, ..Settings::default() };
    let film = render(scene, bvh, camera, &probe, &|_, _| {}, &AtomicBool::new(false))?;
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
    let part = n_black as f64 / n_seen.max(1) as f64;
    (part > PART).then(|| {
        format!("{:.1} % of the picture are black; try --exposure auto, another light or another camera", 100.0 * part)
    })
}

/// The factor for the default light that gives a well exposed picture: interiors lit through openings need more than 1, and white
/// surfaces in the sun less.
///
/// Measured on a small picture, because radiance is proportional to the light.
fn default_light_strength(scene: &Scene, bvh: &SceneBvh, camera: &Camera, settings: &Settings) -> Result<f32> {
    /// Mean radiance of a well exposed picture.
    const MEAN: f64 = 0.3;
    /// A white diffuse surface that faces the sun of strength 1 has a blue radiance of 1.19.
    const LIMITS: (f64, f64) = (0.84, 32.0);
    /// Part of the pixels with geometry that may be as bright as white or brighter.
    const CLIPPED: f64 = 0.05;
    let film = probe(scene, bvh, camera, settings)?;
    let sum: f64 = film.pixels().iter().flat_map(|pixel| pixel.mean()).sum();
    let mean = sum / (3 * film.pixels().len()) as f64;
    let bright = quantile(&seen(&film, |[r, g, b]| r.max(g).max(b)), 1.0 - CLIPPED);
    // A dark interior keeps bright openings.
    let least = (1.0 / bright.max(f64::MIN_POSITIVE)).clamp(LIMITS.0, 1.0);
    let strength = (MEAN / mean.max(f64::MIN_POSITIVE)).clamp(least, LIMITS.1) as f32;
    Ok(strength)
}

/// Stops that show what the lights of the scene light: where most of it would be white or black; else `None`.
fn needed_stops(scene: &Scene, bvh: &SceneBvh, camera: &Camera, settings: &Settings) -> Result<Option<f32>> {
    /// Bright and dark luminances, and the parts of the geometry that need stops where they are beyond.
    const WHITE: f64 = 1.0;
    const BLACK: f64 = 0.02;
    const PART: f64 = 0.3;
    /// Luminance that a tenth of the geometry exceeds, afterwards.
    const BRIGHT: f64 = 0.8;
    const LIMIT: f32 = 20.0;
    let all = seen(&probe(scene, bvh, camera, settings)?, luminance);
    let bright = quantile(&all, 0.9);
    // Where nothing is lit, no exposure shows it.
    if bright <= 0.0 || quantile(&all, 1.0 - PART) < WHITE && bright > BLACK {
        return Ok(None);
    }
    let stops = ((BRIGHT / bright).log2() as f32).clamp(-LIMIT, LIMIT);
    // Tenths are what people give.
    Ok(Some((10.0 * stops).round() / 10.0))
}

/// A small picture with the depth of geometry. It does not depend on the sample range, so that all parts of a picture agree.
fn probe(scene: &Scene, bvh: &SceneBvh, camera: &Camera, settings: &Settings) -> Result<Film> {
    let [width, height] = [settings.width, settings.height].map(|side| side.min(PROBE_SIDE));
    let (samples, part, noise, aovs) = (16, None, None, Aovs::NONE.with(Aov::Depth));
    let probe = Settings { width, height, samples, part, noise, aovs, ..*settings };
    // Not cancellable: before there is a partial result, a signal ends the process.
    Ok(render(scene, bvh, camera, &probe, &|_, _| {}, &AtomicBool::new(false))?)
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
