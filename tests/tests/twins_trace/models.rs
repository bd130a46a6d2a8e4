//! Real models as the renderer prepares them.

use canted_fixtures::device_tests::{Test, needs_device};
use std::path::Path;

use canted_fixtures::Mesh;
use canted_gpu::Gpu;
use canted_renderer::{Levels, SceneBvh, SceneBvhConfig, flatten, traced_scene};
use canted_tests::{rays, scenes as models};
use canted_trace::{Intersect, Ray};

use super::gpu;
use super::reference::{Tally, World, error_of_instance, error_of_one_level};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(models_lose_no_hit).unless(models::missing())]
}

fn reach(positions: &[[f32; 3]]) -> f64 {
    positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs()))
}

/// Compares a model on the device with the CPU, in one level or in two.
fn check(gpu: &Gpu, folder: &Path, file: &str, levels: Levels) {
    let scene = canted_scene::read(&folder.join(file)).unwrap();
    let config = SceneBvhConfig { levels, ..SceneBvhConfig::default() };
    let bvh = SceneBvh::build(&scene, &config).unwrap();
    let traced = traced_scene(gpu, &scene, &bvh).unwrap();
    let (positions, triangles, first) = flatten(&scene).unwrap();
    let reach_world = reach(&positions);
    let reaches: Vec<f64> = scene.meshes.iter().map(|mesh| reach(&mesh.positions)).collect();
    let flat = Mesh { positions, triangles };
    let all_rays =
        [rays::of_all_classes(&flat, 300, 7), rays::from_inside(&flat, 2000, 8), rays::from_afar(&flat, 10.0, 500, 9)]
            .concat();
    // With one level the BVH is over vertices rounded in world space, with two over those of the meshes.
    let of_flat = |instance: u32, primitive: u32| flat.corners((first[instance as usize] + primitive) as usize);
    let of_instance = |instance: u32, primitive: u32| {
        let instance = &scene.instances[instance as usize];
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let corner = |i: u32| instance.world_from_object.point_f64(mesh.positions[i as usize].map(f64::from));
        mesh.triangles[primitive as usize].map(corner)
    };
    let error_of_flat = |ray: &Ray, _: u32| error_of_one_level(ray, reach_world);
    let error_of_placed = |ray: &Ray, instance: u32| {
        let instance = &scene.instances[instance as usize];
        error_of_instance(ray, &instance.world_from_object, reaches[instance.mesh.0 as usize])
    };
    let world = if levels == Levels::Two {
        World { corners: &of_instance, error: &error_of_placed }
    } else {
        World { corners: &of_flat, error: &error_of_flat }
    };
    let mut tally = Tally::default();
    world
        .check_all(gpu, &traced, &all_rays, |ray| bvh.closest_hit(ray), &mut tally)
        .unwrap_or_else(|error| panic!("{file}, {levels:?}: {error}"));
    tally.report(&format!("{file}, {levels:?}"));
}

fn models_lose_no_hit() {
    let gpu = gpu();
    let folder = models::folder();
    check(&gpu, &folder, "stanford/bunny.ply", Levels::One);
    check(&gpu, &folder, "sponza/sponza.obj", Levels::One);
    check(&gpu, &folder, "sponza/sponza.obj", Levels::Two);
    check(&gpu, &folder, "kitchen/country_kitchen.glb", Levels::Two);
    check(&gpu, &folder, "instanced/pine_forest.glb", Levels::Two);
}
