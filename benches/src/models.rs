//! The measured scenes: generated ones, and real models where they are at hand.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_fixtures::{COUNTRY_KITCHEN_VIEWS, Mesh, RayData, SCENES, SPONZA_VIEWS, View, object_views};
use canted_scene::Scene;

/// A scene as one mesh in world space, and the views it is measured from.
pub(crate) struct Model {
    pub(crate) mesh: Mesh,
    pub(crate) views: [View; 4],
}

impl Model {
    /// Camera rays of all views, scanline order.
    pub(crate) fn camera_rays(&self, resolution: u32) -> Vec<RayData> {
        self.views.iter().flat_map(|view| view.rays(resolution)).collect()
    }
}

/// Real models by name: file in the folder of scenes, and views where it is an interior.
const FILES: [(&str, &str, Option<[View; 4]>); 5] = [
    ("bunny", "stanford/bunny.ply", None),
    ("sponza", "sponza/sponza.obj", Some(SPONZA_VIEWS)),
    ("dragon_871k", "stanford/dragon_871k.glb", None),
    ("country_kitchen", "kitchen/country_kitchen.glb", Some(COUNTRY_KITCHEN_VIEWS)),
    ("eiffel", "truss/eiffel.glb", None),
];

/// Folder of real models: `CANTED_SCENES`, else `../shared/scenes` beside the workspace.
fn folder() -> PathBuf {
    std::env::var_os("CANTED_SCENES")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes")), PathBuf::from)
}

/// Makes or loads a scene; `None` for a real model that is not at hand.
pub(crate) fn load(name: &str) -> Result<Option<Model>> {
    if let Some(scene) = SCENES.iter().find(|scene| scene.name == name) {
        let mesh = (scene.generate)();
        let views = object_views(&mesh);
        return Ok(Some(Model { mesh, views }));
    }
    let Some(scene) = scene(name)? else { return Ok(None) };
    let (positions, triangles, _) = canted_renderer::flatten(&scene);
    let mesh = Mesh { positions, triangles };
    let views = FILES.iter().find_map(|(known, _, views)| (*known == name).then_some(*views)).flatten();
    let views = views.unwrap_or_else(|| object_views(&mesh));
    Ok(Some(Model { mesh, views }))
}

/// Reads a real model; `None` where it is not at hand.
pub(crate) fn scene(name: &str) -> Result<Option<Scene>> {
    let (_, file, _) =
        FILES.iter().find(|(known, _, _)| *known == name).ok_or_else(|| anyhow!("there is no scene '{name}'"))?;
    let path = folder().join(file);
    Ok(if path.exists() { Some(canted_scene::read(&path)?) } else { None })
}
