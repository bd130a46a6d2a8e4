//! Pictures of the hybrid integrator: the same samples on both devices.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{Levels, Settings};
use canted_scene::Environment;

use super::compared::{compared, difference, frame_of, on_cpu, on_device, scene_bvh};
use super::{gpu, scenes};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(the_built_in_scene),
        needs_device(a_room_with_all_kinds_of_light),
        needs_device(the_comparison_detects_another_light),
    ]
}

fn small(samples: u32) -> Settings {
    Settings { width: 64, height: 36, samples, ..Settings::default() }
}

fn the_built_in_scene() {
    let gpu = gpu();
    let scene = canted_scene::builtin();
    let camera = frame_of(&scene);
    compared(&gpu, &scene, &camera, Levels::Auto, &small(4)).check("built-in", [0.2, 0.005]);
}

fn a_room_with_all_kinds_of_light() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::room();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &small(4)).check("room", [0.1, 0.005]);
    }
    for environment in [scenes::sky(), Environment::Constant([0.0; 3])] {
        scene.environment = Some(environment);
        compared(&gpu, &scene, &camera, Levels::One, &small(4)).check("another sky", [0.1, 0.005]);
    }
}

fn the_comparison_detects_another_light() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &small(2));
    let mut brighter = scene.clone();
    brighter.materials[0].base_color[1] += 0.01;
    let found = difference(&ours, &on_cpu(&brighter, &bvh, &camera, &small(2)));
    assert!(found.astray > 0.5 && found.of_means > 0.001 && found.drift[1] > 6.0, "{found:?}");
}
