//! What rendering starts from: the built scene, the camera, the light and the integrator.

use anyhow::{Result, anyhow};
use canted_renderer::{Integrator, Prepared, prepare};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;

use super::{Args, exposure};
use crate::{
    light::{self, LightSource},
    load, output,
};

/// A scene ready to render.
pub(crate) struct Setup<K: LaneKernel> {
    pub(crate) prepared: Prepared<K>,
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

/// Builds the scene, and chooses camera, light and integrator, which it sets in `args`.
pub(crate) fn setup<K: LaneKernel>(scene: &mut Scene, args: &mut Args, source: LightSource) -> Result<Setup<K>> {
    let name = load::name(args.scene.as_deref());
    let mut prepared: Prepared<K> =
        prepare(scene, &args.structure.config(scene)?).map_err(|error| anyhow!("{name}: {error}"))?;
    let camera = args.camera.camera(scene, &prepared, args.size)?;
    let source = decided(scene, &mut prepared, &camera, args, source)?;
    let choice = choose(scene, &prepared, &camera, args, source)?;
    Ok(Setup { prepared, camera, choice })
}

/// Whether emission alone lights the scene, decided by a small picture; if not, adds the default light and reports it.
pub(crate) fn decided<K: LaneKernel>(
    scene: &mut Scene,
    prepared: &mut Prepared<K>,
    camera: &Camera,
    args: &Args,
    source: LightSource,
) -> Result<LightSource> {
    if source != LightSource::Emission || args.heatmap.is_some() {
        return Ok(source);
    }
    let lit = exposure::fraction_lit_by_emission(scene, prepared, camera, args.size)?;
    if lit >= exposure::LIT_FRACTION {
        return Ok(source);
    }
    output::note(&format!(
        "added the default light: the scene's own emission lights {:.0} % of what is seen; --env 0,0,0 renders without",
        100.0 * lit
    ));
    light::set_default(scene, 1.0, args.camera.up());
    // They were listed before there was a light.
    prepared.unused.retain(|unused| !["listed lights", "light selection"].contains(&unused.feature));
    Ok(LightSource::Default)
}

/// Chooses the integrator, and scales the default light if it is used.
pub(crate) fn choose<K: LaneKernel>(
    scene: &mut Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    args: &mut Args,
    source: LightSource,
) -> Result<Choice> {
    let is_free = args.integrator.is_none();
    let mut integrator_reason = args.choose_integrator(scene, source == LightSource::Emission);
    if source != LightSource::Default || args.heatmap.is_some() {
        let is_exposed = source != LightSource::Default && args.needs_exposure();
        let exposure = if is_exposed { expose(scene, prepared, camera, args)? } else { None };
        return Ok(Choice { default_light: None, exposure, integrator_reason });
    }
    light::set_default(scene, 1.0, args.camera.up());
    let mut strength = exposure::default_light_strength(scene, prepared, camera, &args.settings()?)?;
    if is_free && args.integrator == Some(Integrator::Path) && strength > MAX_PATH_STRENGTH {
        args.integrator = Some(Integrator::Hybrid);
        integrator_reason = "little of the default light gets in";
        strength = exposure::default_light_strength(scene, prepared, camera, &args.settings()?)?;
    }
    light::set_default(scene, strength, args.camera.up());
    Ok(Choice { default_light: Some(strength), exposure: None, integrator_reason })
}

/// A room that needs the default light stronger than this is dark and noisy by `path`: nearly all light comes through small openings.
/// The ambient light of `hybrid` shows it.
const MAX_PATH_STRENGTH: f32 = 3.0;

/// Sets the exposure where the lights of the file would give a white or a black picture, reports it, and returns it.
fn expose<K: LaneKernel>(
    scene: &Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    args: &mut Args,
) -> Result<Option<f32>> {
    let stops = exposure::needed_stops(scene, prepared, camera, &args.settings()?)?;
    if let Some(stops) = stops {
        let what = if stops < 0.0 { "white" } else { "black" };
        output::note(&format!(
            "--exposure {stops}: the lights of the file would leave most of the picture {what}; --exposure 0 keeps them as they are"
        ));
    }
    // Also decides for later pictures of a sequence, which must not flicker.
    args.look.set_stops(Some(stops.unwrap_or(0.0)));
    Ok(stops)
}
