//! From where a scene is seen, and in which light.

use anyhow::{Result, anyhow};
use canted_renderer::{Prepared, prepare};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;

use super::{Args, exposure::strength_of_default_light};
use crate::{light, load};

/// A scene that is ready for its picture.
pub(crate) struct Looked<K: LaneKernel> {
    pub(crate) prepared: Prepared<K>,
    pub(crate) camera: Camera,
    /// Strength of our own light, where it shines.
    pub(crate) default_light: Option<f32>,
}

/// Builds the scene and chooses the camera; `default_light` says that the light is ours to choose too.
pub(crate) fn look<K: LaneKernel>(scene: &mut Scene, args: &Args, default_light: bool) -> Result<Looked<K>> {
    let name = load::name(args.scene.as_deref());
    let prepared: Prepared<K> =
        prepare(scene, &args.structure.config(scene)).map_err(|error| anyhow!("{name}: {error}"))?;
    let camera = args.camera.camera(scene, &prepared, args.size)?;
    let settings = args.settings()?;
    let mut strength = None;
    if default_light && args.heatmap.is_none() {
        let by = strength_of_default_light(scene, &prepared, &camera, &settings)?;
        light::set_default(scene, by);
        strength = Some(by);
    }
    Ok(Looked { prepared, camera, default_light: strength })
}
