//! Real models with both integrators: the same samples on both devices.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{Integrator, Levels, Settings};
use canted_scene::{Light, Scene};
use canted_tests::scenes as models;

use super::compared::{compared, frame_of};
use super::gpu;

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(models_render_the_same_pictures).unless(models::missing())]
}

/// Files in the folder of models, and the greatest share of diverging pixels: leaves and thin textured cloth split many paths.
const FILES: [(&str, f64); 4] = [
    ("sponza/sponza.gltf", 0.3),
    ("kitchen/country_kitchen.glb", 0.3),
    ("truss/eiffel.glb", 0.3),
    ("instanced/pine_forest.glb", 0.4),
];

fn models_render_the_same_pictures() {
    let gpu = gpu();
    let folder = models::folder();
    for (file, astray) in FILES {
        let scene = canted_scene::read(&folder.join(file)).unwrap();
        let sun = Light::Sun { direction: [-0.2, -0.95, -0.25], irradiance: [3.0, 2.9, 2.6] };
        let scene = Scene { environment: Some([0.6, 0.8, 1.0].into()), lights: vec![sun], ..scene };
        let camera = frame_of(&scene);
        for integrator in [Integrator::Hybrid, Integrator::Path] {
            let settings =
                Settings { width: 48, height: 27, samples: 2, integrator, bounces: 3, ..Settings::default() };
            let found = compared(&gpu, &scene, &camera, Levels::Auto, &settings);
            found.check(&format!("{file}, {integrator:?}"), [astray, 0.02]);
        }
    }
}
