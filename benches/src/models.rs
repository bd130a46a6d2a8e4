//! The measured scenes: generated ones, and real models where they are at hand.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_fixtures::{COUNTRY_KITCHEN_VIEWS, Mesh, RayData, SCENES, SPONZA_VIEWS, View, object_views};
use canted_lbvh::{Bits, Corners, Domain, Leaf, Tree};
use canted_obb::Aabb;
use canted_sah::{PlocConfig, ReinsertConfig};
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

/// The tree that the program traces: PLOC, improved by reinsertion.
pub(crate) fn default_tree(corners: &[Corners], bounds: &Aabb) -> Tree {
    let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
    let codes = canted_lbvh::codes_of_boxes(&Domain::new(bounds, 2, Bits::B63), &boxes);
    let sorted = canted_lbvh::by_code(&codes, Bits::B63);
    let in_order: Vec<Aabb> = sorted.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    let tree = canted_sah::ploc(sorted, &in_order, &PlocConfig::default());
    let in_order: Vec<Aabb> = tree.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    canted_sah::reinsert(&tree, &in_order, &ReinsertConfig::BALANCED)
}
