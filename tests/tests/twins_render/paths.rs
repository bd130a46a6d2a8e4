//! Pictures of the path integrator: the same samples on both devices.
//!
//! Mirrors and glass amplify rounding, and paths have many vertices that may diverge, so more pixels diverge than with the hybrid
//! integrator. The shares here are about twice the measured ones, and sums over diverging pixels must be unbiased.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{DevicePicture, Integrator, Levels, Pattern, Settings, Surfaces};
use canted_scene::{Camera, Environment, Material, Scene, SceneFile};
use std::path::Path;

use super::compared::{compared, difference, on_cpu, on_device, scene_bvh};
use super::{gpu, scenes};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(a_room_with_all_kinds_of_light),
        needs_device(metal_and_glass_before_a_sky),
        needs_device(motion_while_the_shutter_is_open),
        needs_device(the_motion_example),
        needs_device(textures_of_every_slot),
        needs_device(the_comparison_detects_another_light),
        needs_device(a_bare_scene_binds_few_buffers),
    ]
}

fn small(samples: u32) -> Settings {
    let integrator = Integrator::Path;
    Settings { width: 64, height: 36, samples, integrator, bounces: 8, ..Settings::default() }
}

fn a_room_with_all_kinds_of_light() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::room();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &small(4)).check("room", [0.3, 0.01]);
    }
    scene.environment = Some(scenes::sky());
    compared(&gpu, &scene, &camera, Levels::One, &small(4)).check("sky", [0.3, 0.01]);
}

/// The room with a different material for each block.
fn of_all_materials() -> (Scene, Camera) {
    let (mut scene, camera) = scenes::room();
    scene.environment = Some(scenes::sky());
    scene.materials.extend([
        Material { roughness: 0.0, specular: 1.0, transmission: 1.0, ..Material::default() },
        Material { base_color: [0.9, 0.7, 0.4], metallic: 1.0, roughness: 0.2, ..Material::default() },
    ]);
    scene.meshes[1].parts[0].material.0 = 3;
    scene.meshes[2].parts[0].material.0 = 4;
    (scene, camera)
}

fn metal_and_glass_before_a_sky() {
    let gpu = gpu();
    let (mut scene, camera) = of_all_materials();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &small(4)).check("metal and glass", [0.4, 0.02]);
    }
    let clear = scene.materials[3].clone();
    let kinds = [
        ("rough glass", Material { roughness: 0.4, ..clear.clone() }),
        ("sheets", Material { roughness: 0.4, thin_walled: true, ..clear.clone() }),
        ("a glossy layer and no glass", Material { roughness: 0.3, transmission: 0.0, ..clear }),
    ];
    for (name, material) in kinds {
        scene.materials[3] = material;
        compared(&gpu, &scene, &camera, Levels::One, &small(4)).check(name, [0.4, 0.02]);
    }
}

fn motion_while_the_shutter_is_open() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::in_motion(scenes::textured());
    for pattern in [Pattern::Random, Pattern::Stratified, Pattern::Sobol] {
        let settings = Settings { pattern, ..small(4) };
        compared(&gpu, &scene, &camera, Levels::Auto, &settings).check("textures", [0.4, 0.02]);
    }
    (scene, _) = scenes::in_motion(scenes::room());
    let (_, camera) = scenes::room();
    let settings = Settings { integrator: Integrator::Hybrid, ..small(4) };
    compared(&gpu, &scene, &camera, Levels::Auto, &settings).check("room", [0.3, 0.01]);
    // The comparison detects a scene without motion.
    let bvh = scene_bvh(&scene, Levels::Auto);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
    let (still, _) = scenes::room();
    let found =
        difference(&ours, &on_cpu(&still, &super::compared::scene_bvh(&still, Levels::Two), &camera, &settings));
    assert!(found.astray > 0.5, "{found:?}");
}

fn the_motion_example() {
    let gpu = gpu();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/motion.toml");
    let scene = SceneFile::read(&path).unwrap().load().unwrap();
    let camera = scene.cameras[0];
    compared(&gpu, &scene, &camera, Levels::Auto, &small(8)).check("motion.toml", [0.3, 0.01]);
}

fn textures_of_every_slot() {
    let gpu = gpu();
    let (scene, camera) = scenes::textured();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &small(4)).check("textures", [0.4, 0.02]);
    }
}

fn the_comparison_detects_another_light() {
    let gpu = gpu();
    let (scene, camera) = of_all_materials();
    let bvh = scene_bvh(&scene, Levels::One);
    let settings = small(8);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
    let mut brighter = scene.clone();
    brighter.materials[0].base_color = [0.71; 3];
    let found = difference(&ours, &on_cpu(&brighter, &bvh, &camera, &settings));
    assert!(found.astray > 0.8 && found.drift.iter().all(|&drift| drift > 6.0), "{found:?}");
}

/// Features that a scene does not use have no binding.
fn a_bare_scene_binds_few_buffers() {
    let gpu = gpu();
    let settings = small(1);
    let bindings = |scene: &Scene, camera: &Camera, levels: Levels| {
        let bvh = scene_bvh(scene, levels);
        let surfaces = Surfaces::with_lod(scene, settings.lod);
        let picture = DevicePicture::new(&gpu, &surfaces, &bvh, camera, &settings).unwrap();
        let mut names: Vec<String> = picture.buffers().into_iter().map(|(name, _)| name.to_owned()).collect();
        names.sort();
        names
    };
    let (full, camera) = scenes::room();
    let mut bare = full.clone();
    bare.lights.clear();
    bare.meshes.truncate(1);
    bare.instances.truncate(1);
    let expected =
        ["bvhs", "light_probabilities", "materials", "nodes", "picture", "triangle_blocks", "triangles", "vertices"];
    assert_eq!(bindings(&bare, &camera, Levels::One), expected);

    let all = bindings(&full, &camera, Levels::Two);
    let more = [
        "emitters",
        "instance_order",
        "light_leaves",
        "light_nodes",
        "lights",
        "placements",
        "instances",
        "sampled_suns",
    ];
    assert_eq!(all.len(), expected.len() + more.len());
    assert!(more.iter().all(|name| all.iter().any(|known| known == name)), "{all:?}");

    bare.environment = Some(Environment::Constant([0.0; 3]));
    assert_eq!(bindings(&bare, &camera, Levels::One).len(), expected.len());
}
