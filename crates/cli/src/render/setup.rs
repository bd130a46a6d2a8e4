//! What rendering starts from: the built scene, the ground below it, the camera, the integrator, the light and the background.
//!
//! ```text
//! scene -> subject -> ground -> structure -> view that frames it -> camera -> is emission light? -> light, exposure, background
//! ```

use anyhow::{Result, anyhow};
use canted_renderer::{Integrator, MipMaps, SceneBvh, Shown, Subject, UpdateOptions};
use canted_scene::{Camera, Scene};

use super::probes::{default_light_strength, lit_by_emission, needed_stops};
use crate::{
    camera::{CameraSource, Staged},
    light::{self, Background, LightSource, Preset, ground},
    load, output,
    settings::Plan,
};

/// A scene ready to render.
pub(crate) struct Setup {
    pub(crate) bvh: SceneBvh,
    pub(crate) camera: Camera,
    pub(crate) choice: Choice,
    /// Those of small pictures, if any was needed.
    pub(crate) mip_maps: Option<MipMaps>,
}

/// What was decided for a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// Where the camera comes from.
    pub(crate) camera: CameraSource,
    /// Where the light comes from.
    pub(crate) source: LightSource,
    /// The light that needs no file, and its strength, if it is used.
    pub(crate) default_light: Option<(Preset, f32)>,
    /// Why it was chosen, where that is not obvious.
    pub(crate) light_reason: Option<&'static str>,
    /// The exposure in stops, where one was chosen other than 0.
    pub(crate) exposure: Option<f32>,
    /// Why the integrator was chosen.
    pub(crate) integrator_reason: &'static str,
}

/// What is reported where z is up because the scene shows it.
pub(super) const Z_UP: &str = "z is up: the object stands on a flat base across z; --up-axis y keeps y up";

/// Builds the scene, and chooses camera, light and integrator, which it sets in `plan`.
pub(crate) fn setup(scene: &mut Scene, plan: &mut Plan, source: LightSource) -> Result<Setup> {
    let name = load::name(plan.source.scene.as_deref());
    if plan.shows_z_up(scene) {
        plan.set_z_up();
        output::note(Z_UP);
    }
    let config = plan.structure.config_for(scene);
    let mut build = |scene: &Scene| SceneBvh::build(scene, &config).map_err(|error| anyhow!("{name}: {error}"));
    let (mut bvh, mut staged) = stage(scene, plan, source, &mut build)?;
    let (camera, of_camera) = plan.camera(scene, &bvh, staged.as_ref())?;
    let source = decided(scene, &bvh, &camera, plan, source, &mut staged)?;
    settle(scene, &mut bvh, &camera, plan, source, staged.as_ref())?;
    let mut mip_maps = None;
    let choice = choose(scene, &mut bvh, (&camera, of_camera), plan, source, staged.as_ref(), &mut mip_maps)?;
    Ok(Setup { bvh, camera, choice, mip_maps })
}

/// Builds the structure of a scene by `build`, with the ground that it probably has; the result is `None` if neither the camera nor the light
/// depends on what the scene is about.
pub(crate) fn stage(
    scene: &mut Scene,
    plan: &Plan,
    source: LightSource,
    build: &mut dyn FnMut(&Scene) -> Result<SceneBvh>,
) -> Result<(SceneBvh, Option<Staged>)> {
    ground::remove(scene);
    if !is_needed(scene, plan, source) {
        return Ok((build(scene)?, None));
    }
    let subject = Subject::new(scene, plan.up());
    // A camera inside the scene probably shows a room, and to remove the ground again is to build again.
    let is_room = plan.stage.ground.is_none() && scene.cameras.iter().any(|camera| subject.is_within(camera.eye));
    if !is_room && may_have_ground(scene, plan, source, &subject, is_wide(plan, &subject)) {
        ground::add(scene, &subject, plan.up());
    }
    let bvh = build(scene)?;
    let staged = of_subject(scene, &bvh, plan, subject);
    Ok((bvh, Some(staged)))
}

/// What a scene is about, whose structure is built; `None` if neither the camera nor the light depends on it.
pub(crate) fn staged(scene: &Scene, bvh: &SceneBvh, plan: &Plan, source: LightSource) -> Option<Staged> {
    is_needed(scene, plan, source).then(|| of_subject(scene, bvh, plan, Subject::new(scene, plan.up())))
}

fn of_subject(scene: &Scene, bvh: &SceneBvh, plan: &Plan, subject: Subject) -> Staged {
    let framed = subject.frame(scene, bvh, plan.aspect());
    let is_landscape = is_wide(plan, &subject) && !subject.has_underside(scene, bvh);
    Staged { subject, framed, is_landscape, reflects: true }
}

/// Whether camera or light depend on what the scene is about.
fn is_needed(scene: &Scene, plan: &Plan, source: LightSource) -> bool {
    source != LightSource::Given || plan.stage.ground == Some(true) || plan.needs_framing(scene)
}

/// Whether a scene has a ground, before its view is known.
fn may_have_ground(scene: &Scene, plan: &Plan, source: LightSource, subject: &Subject, is_landscape: bool) -> bool {
    let is_empty = scene.instances.len() == usize::from(scene.ground.is_some()) || subject.extent() == [0.0; 3];
    match plan.stage.ground {
        Some(is_wanted) => is_wanted && !is_empty,
        None => {
            let is_object = !is_empty && !subject.is_chart() && !subject.has_floor && !is_landscape;
            is_object && source == LightSource::Default && !plan.shows_data && !plan.is_transparent()
        }
    }
}

/// Adds or removes the ground, as the view shows it: no camera sees it from below. Returns whether the structure changed.
pub(crate) fn settle(
    scene: &mut Scene,
    bvh: &mut SceneBvh,
    camera: &Camera,
    plan: &Plan,
    source: LightSource,
    staged: Option<&Staged>,
) -> Result<bool> {
    let Some(Staged { subject, framed: (_, shown), is_landscape, reflects }) = staged else { return Ok(false) };
    let is_seen = *shown != Shown::Room && *reflects && subject.height_of(camera.eye) > 0.0;
    let may_have = may_have_ground(scene, plan, source, subject, *is_landscape);
    let has_ground = may_have && (is_seen || plan.stage.ground.is_some());
    if has_ground == scene.ground.is_some() {
        return Ok(false);
    }
    match has_ground {
        true => ground::add(scene, subject, plan.up()),
        false => ground::remove(scene),
    }
    bvh.update(scene, &UpdateOptions::default())?;
    Ok(true)
}

/// Whether a scene is wide, and of outdoor size in a format whose unit is the meter. It is a landscape unless it has an underside, as objects have
/// in files whose unit is the millimeter all the same.
fn is_wide(plan: &Plan, subject: &Subject) -> bool {
    /// Meters, and width relative to height.
    const SIZE: f64 = 40.0;
    const WIDE: f64 = 4.0;
    let [x, y, z] = subject.extent();
    plan.is_in_meters() && x.max(z) >= SIZE && x.max(z) >= WIDE * y
}

/// Whether emission lights the scene, decided by small pictures; if not, reports that the scene gets the default light.
pub(crate) fn decided(
    scene: &Scene,
    bvh: &SceneBvh,
    camera: &Camera,
    plan: &Plan,
    source: LightSource,
    staged: &mut Option<Staged>,
) -> Result<LightSource> {
    /// The part of the surfaces that emission must light so that the default light is not needed.
    const LIT: f64 = 0.5;
    /// The part of what is seen that reflects, where light shows something.
    const REFLECTING: f64 = 0.5;
    if source != LightSource::Emission || plan.heatmap.is_some() {
        return Ok(source);
    }
    let lit = lit_by_emission(scene, bvh, camera, plan.size())?;
    let reflects = lit.reflecting >= REFLECTING;
    if lit.part >= LIT && reflects {
        return Ok(source);
    }
    if let Some(staged) = staged {
        staged.reflects = reflects;
    }
    if reflects {
        output::note(&format!(
            "added the default light: the scene's own emission lights {:.0} % of the other surfaces; --env 0,0,0 renders without",
            100.0 * lit.part
        ));
    }
    Ok(LightSource::Default)
}

/// Chooses the integrator, the light that needs no file with its strength, the exposure for other light, and the background. Uses and
/// keeps the
/// mip maps of textures.
pub(crate) fn choose(
    scene: &mut Scene,
    bvh: &mut SceneBvh,
    (camera, of_camera): (&Camera, CameraSource),
    plan: &mut Plan,
    source: LightSource,
    staged: Option<&Staged>,
    mip_maps: &mut Option<MipMaps>,
) -> Result<Choice> {
    let is_free = plan.integrator.is_none();
    let mut integrator_reason = plan.choose_integrator(scene, source == LightSource::Emission);
    let background = plan.stage.background;
    let mut choice = Choice {
        camera: of_camera,
        source,
        default_light: None,
        light_reason: None,
        exposure: None,
        integrator_reason,
    };
    if source != LightSource::Default || plan.heatmap.is_some() {
        scene.background = background.and_then(Background::color);
        ground::paint(scene, plan.up());
        if source != LightSource::Default && plan.needs_exposure() {
            choice.exposure = expose(scene, bvh, camera, plan, mip_maps)?;
        }
        return Ok(choice);
    }
    let is_room = staged.is_some_and(|staged| staged.framed.1 == Shown::Room);
    let is_landscape = staged.is_some_and(|staged| staged.is_landscape);
    let is_outdoors = is_room || is_landscape;
    if plan.stage.light.is_none() && is_landscape && !is_room {
        choice.light_reason = Some("wider than 40 m; --light studio shows it as an object");
    }
    let preset = plan.stage.light.unwrap_or(if is_outdoors { Preset::Sky } else { Preset::Studio });
    let has_environment = preset == Preset::Sky || is_room;
    let usual = if has_environment { Background::Environment } else { Background::DEFAULT };
    let background = background.unwrap_or(usual);
    scene.background = background.color();
    let up = plan.up();
    let set = |scene: &mut Scene, strength| {
        light::set_light(scene, preset, strength, up);
        ground::paint(scene, up);
    };
    set(scene, 1.0);
    if !scene.lights.is_empty() {
        // They were listed for a scene without.
        bvh.unused.retain(|unused| !["listed lights", "light selection"].contains(&unused.feature));
    }
    let mut strength = 1.0;
    if has_environment {
        strength = default_light_strength(scene, bvh, camera, &plan.settings, mip_maps)?;
        if is_free && plan.integrator == Some(Integrator::Path) && strength > MAX_PATH_STRENGTH {
            plan.choose(Integrator::Hybrid);
            integrator_reason = "little of the default light gets in";
            strength = default_light_strength(scene, bvh, camera, &plan.settings, mip_maps)?;
        }
        set(scene, strength);
    }
    plan.keep_stage(preset, background, scene.ground.is_some());
    Ok(Choice { default_light: Some((preset, strength)), integrator_reason, ..choice })
}

/// A room that needs the default light stronger than this is dark and noisy by `path`: nearly all light comes through small openings.
/// The ambient light of `hybrid` shows it.
const MAX_PATH_STRENGTH: f32 = 3.0;

/// Sets the exposure where the lights of the file would give a white or a black picture, reports it, and returns it.
fn expose(
    scene: &Scene,
    bvh: &SceneBvh,
    camera: &Camera,
    plan: &mut Plan,
    mip_maps: &mut Option<MipMaps>,
) -> Result<Option<f32>> {
    let stops = needed_stops(scene, bvh, camera, &plan.settings, mip_maps)?;
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
