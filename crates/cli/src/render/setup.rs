//! What rendering starts from: the built scene, the camera and the light.

use anyhow::{Result, anyhow};
use canted_renderer::{Prepared, prepare};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;

use super::{Args, exposure};
use crate::{light, load};

/// A scene ready to render.
pub(crate) struct Setup<K: LaneKernel> {
    pub(crate) prepared: Prepared<K>,
    pub(crate) camera: Camera,
    /// Strength of the default light, if the scene has no other.
    pub(crate) default_light: Option<f32>,
}

/// Builds the scene, chooses the camera and scales the default light, if the scene has no other.
pub(crate) fn setup<K: LaneKernel>(scene: &mut Scene, args: &Args, has_default_light: bool) -> Result<Setup<K>> {
    let name = load::name(args.scene.as_deref());
    let prepared: Prepared<K> =
        prepare(scene, &args.structure.config(scene)?).map_err(|error| anyhow!("{name}: {error}"))?;
    let camera = args.camera.camera(scene, &prepared, args.size)?;
    let default_light = scale_default_light(scene, &prepared, &camera, args, has_default_light)?;
    Ok(Setup { prepared, camera, default_light })
}

/// Scales the default light, if the scene has no other. Returns its strength.
pub(super) fn scale_default_light<K: LaneKernel>(
    scene: &mut Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    args: &Args,
    has_default_light: bool,
) -> Result<Option<f32>> {
    if !has_default_light || args.heatmap.is_some() {
        return Ok(None);
    }
    let strength = exposure::default_light_strength(scene, prepared, camera, &args.settings()?)?;
    light::set_default(scene, strength);
    Ok(Some(strength))
}
