//! The measured scenes: generated ones, and real models where available.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_fixtures::{
    COUNTRY_KITCHEN_VIEWS, Mesh, RayData, SCENES, SPONZA_VIEWS, View, object_views, scaffold_nodes, scaffold_of,
};
use canted_lbvh::{Corners, Leaf, Tree};
use canted_obb::Aabb;
use canted_scene::Scene;
use canted_tlas::Instance;

/// A scene as one mesh in world space, and the views it is measured from.
pub(crate) struct Model {
    pub(crate) mesh: Mesh,
    pub(crate) views: [View; 4],
    /// The meshes and their instances, for a scene that places its meshes often.
    pub(crate) placed: Option<Placed>,
}

/// Meshes in object space, and their instances.
pub(crate) struct Placed {
    pub(crate) meshes: Vec<Mesh>,
    pub(crate) instances: Vec<Instance>,
}

impl Model {
    /// Camera rays of all views, scanline order.
    pub(crate) fn camera_rays(&self, resolution: u32) -> Vec<RayData> {
        self.views.iter().flat_map(|view| view.rays(resolution)).collect()
    }

    /// The model and its views, rotated.
    fn rotated(self) -> Self {
        Self { mesh: self.mesh.off_axis(), views: self.views.map(View::off_axis), placed: None }
    }
}

/// Real models by name: file in the folder of scenes, and views where it is an interior.
const FILES: [(&str, &str, Option<[View; 4]>); 12] = [
    ("bunny", "stanford/bunny.ply", None),
    ("sponza", "sponza/sponza.obj", Some(SPONZA_VIEWS)),
    ("sponza_gltf", "sponza/sponza.gltf", Some(SPONZA_VIEWS)),
    ("dragon_res2", "stanford/dragon_res2.ply", None),
    ("dragon_871k", "stanford/dragon_871k.glb", None),
    ("country_kitchen", "kitchen/country_kitchen.glb", Some(COUNTRY_KITCHEN_VIEWS)),
    ("eiffel", "truss/eiffel.glb", None),
    ("truss_bridge", "truss/truss_bridge.glb", None),
    ("radio_tower", "truss/radio_tower.glb", None),
    ("tower_crane", "truss/tower_crane.glb", None),
    ("truss_stage", "truss/truss_stage.glb", None),
    (TOWER_FIELD, "instanced/tower_field.glb", None),
];

/// The scene that is measured with a TLAS.
const TOWER_FIELD: &str = "tower_field";

/// Suffix of the name of a rotated scene.
const ROTATED: &str = "_rotated";

/// Folder of real models: `CANTED_SCENES`, else `../shared/scenes` next to the workspace.
pub(crate) fn folder() -> PathBuf {
    std::env::var_os("CANTED_SCENES")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes")), PathBuf::from)
}

/// A lattice of few triangles, for tests.
pub(crate) const SMALL: &str = "small scaffold";

/// A mesh with its default views.
pub(crate) fn of_mesh(mesh: Mesh) -> Model {
    Model { views: object_views(&mesh), mesh, placed: None }
}

/// Generates or loads a scene; `None` for a real model that is not available. `NAME_rotated` is NAME rotated so that no axis is aligned.
pub(crate) fn load(name: &str) -> Result<Option<Model>> {
    if let Some(aligned) = name.strip_suffix(ROTATED) {
        return Ok(load(aligned)?.map(Model::rotated));
    }
    if name == SMALL {
        return Ok(Some(of_mesh(scaffold_of(1, false, scaffold_nodes(10)))));
    }
    if let Some(scene) = SCENES.iter().find(|scene| scene.name == name) {
        return Ok(Some(of_mesh((scene.generate)())));
    }
    let Some(scene) = scene(name)? else { return Ok(None) };
    let (positions, triangles, _) = canted_renderer::flatten(&scene)?;
    let mesh = Mesh { positions, triangles };
    let views = FILES.iter().find_map(|(known, _, views)| (*known == name).then_some(*views)).flatten();
    let views = views.unwrap_or_else(|| object_views(&mesh));
    let placed = (name == TOWER_FIELD).then(|| placed(&scene));
    Ok(Some(Model { mesh, views, placed }))
}

fn placed(scene: &Scene) -> Placed {
    let mesh =
        |mesh: &canted_scene::Mesh| Mesh { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() };
    let instance = |instance: &canted_scene::Instance| Instance::new(instance.mesh.0, instance.world_from_object);
    Placed {
        meshes: scene.meshes.iter().map(mesh).collect(),
        instances: scene.instances.iter().map(instance).collect(),
    }
}

/// Reads a real model; `None` if it is not available.
pub(crate) fn scene(name: &str) -> Result<Option<Scene>> {
    Ok(path(name)?.map(|path| canted_scene::read(&path)).transpose()?)
}

/// The file of a real model; `None` if it is not available.
pub(crate) fn path(name: &str) -> Result<Option<PathBuf>> {
    let (_, file, _) =
        FILES.iter().find(|(known, _, _)| *known == name).ok_or_else(|| anyhow!("there is no scene '{name}'"))?;
    Ok(Some(folder().join(file)).filter(|path| path.exists()))
}

/// The binary tree that the program builds when no wide BVH is requested.
pub(crate) fn binary_tree(corners: &[Corners], bounds: &Aabb) -> Tree {
    let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
    canted_sah::build(&boxes, bounds, &canted_sah::Builder::default())
}
