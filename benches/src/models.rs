//! The measured scenes: generated ones, and real models where available; their rays: camera rays of views, and rays that start where these
//! hit.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_fixtures::{
    COUNTRY_KITCHEN_VIEWS, DIFFUSE_SEED, Mesh, OCCLUSION_SEED, RayData, SCENES, SPONZA_VIEWS, SurfacePoint, View,
    diffuse, object_views, occlusion, scaffold_nodes, scaffold_of,
};
use canted_lbvh::{Corners, Leaf, Tree};
use canted_obb::Aabb;
use canted_scene::Scene;
use canted_tlas::Instance;
use canted_trace::{Hit, Ray};

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

/// The scene of the program.
pub(crate) const BUILT_IN: &str = "built-in";

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

/// The scene that the program draws without a file, or a real model; `None` if it is not available.
pub(crate) fn scene(name: &str) -> Result<Option<Scene>> {
    if name == BUILT_IN {
        return Ok(Some(canted_scene::builtin()));
    }
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

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Nearest hits of the views' pixels.
    Camera,
    /// Nearest hits of one scattered ray from each camera hit.
    Diffuse,
    /// Whether anything is near each camera hit.
    Occlusion,
}

impl Kind {
    pub(crate) const ALL: [Self; 3] = [Self::Camera, Self::Diffuse, Self::Occlusion];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Diffuse => "diffuse",
            Self::Occlusion => "occlusion",
        }
    }
}

/// The camera rays of a model.
pub(crate) fn camera(model: &Model, resolution: u32) -> Vec<Ray> {
    model.camera_rays(resolution).iter().map(ray).collect()
}

/// The rays that start where camera rays hit: for nearest hits, and for occlusion.
pub(crate) fn secondary(model: &Model, camera: &[Ray], hits: &[Option<Hit>]) -> [Vec<Ray>; 2] {
    secondary_farther(model, camera, hits, 0.0)
}

/// The same, but they start `farther` from their surfaces, relative to the diagonal of the scene.
pub(crate) fn secondary_farther(model: &Model, camera: &[Ray], hits: &[Option<Hit>], farther: f64) -> [Vec<Ray>; 2] {
    let diagonal = model.mesh.diagonal();
    let moved = |mut point: SurfacePoint| {
        let step = |(x, n): (f32, f32)| (f64::from(x) + farther * diagonal * f64::from(n)) as f32;
        point.position = std::array::from_fn(|k| step((point.position[k], point.normal[k])));
        point
    };
    let points: Vec<SurfacePoint> = camera
        .iter()
        .zip(hits)
        .filter_map(|(ray, hit)| Some(surface_point(model, ray, &(*hit)?)))
        .filter(|point| point.normal != [0.0; 3])
        .map(moved)
        .collect();
    [diffuse(&points, diagonal, DIFFUSE_SEED), occlusion(&points, diagonal, OCCLUSION_SEED)]
        .map(|rays| rays.iter().map(ray).collect())
}

/// Converts a fixture's ray.
pub(crate) fn ray(data: &RayData) -> Ray {
    Ray::new(data.origin, data.direction).between(0.0, data.t_max)
}

/// The hit point, with the normal that faces the ray.
pub(crate) fn surface_point(model: &Model, ray: &Ray, hit: &Hit) -> SurfacePoint {
    let [a, b, c] = model.mesh.corners(hit.primitive.index());
    let sub = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let (ab, ac) = (sub(b, a), sub(c, a));
    let normal = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
    let along: f64 = normal.iter().zip(ray.direction).map(|(n, d)| n * f64::from(d)).sum();
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    let side = if along > 0.0 { -1.0 } else { 1.0 } / if length > 0.0 { length } else { 1.0 };
    SurfacePoint { position: ray.at(f64::from(hit.t)).map(|x| x as f32), normal: normal.map(|n| (n * side) as f32) }
}
