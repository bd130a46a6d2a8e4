//! Guides of camera rays: depth, normals, albedo and counts equal the CPU's up to rounding.

use canted_film::{Aov, Aovs, Film, Guide};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{Integrator, Levels, Settings};

use super::compared::{on_cpu, on_device, scene_bvh};
use super::{gpu, scenes};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(guides_match_the_cpu_for_both_integrators)]
}

/// Rounding error of positions, normals and textures in a pixel's mean, relative to the scene's size or to 1.
const ROUNDING: f64 = 1.0 / 4096.0;

fn is_near(a: &Guide, b: &Guide) -> bool {
    let pairs = [[a.depth / 8.0, b.depth / 8.0]]
        .into_iter()
        .chain((0..3).map(|k| [a.normal[k], b.normal[k]]))
        .chain((0..3).map(|k| [a.shading_normal[k], b.shading_normal[k]]))
        .chain((0..3).map(|k| [a.albedo[k], b.albedo[k]]));
    let n = f64::from(a.n_hits.max(1));
    a.n_hits == b.n_hits && a.first == b.first && pairs.into_iter().all(|[a, b]| (a - b).abs() <= n * ROUNDING)
}

/// The share of pixels with different guides.
fn apart(ours: &Film, theirs: &Film) -> f64 {
    assert_eq!((ours.guides().len(), theirs.guides().len()), (ours.pixels().len(), theirs.pixels().len()));
    let n_apart = ours.guides().iter().zip(theirs.guides()).filter(|(a, b)| !is_near(a, b)).count();

    n_apart as f64 / ours.guides().len() as f64
}

fn guides_match_the_cpu_for_both_integrators() {
    let gpu = gpu();
    let all: Aovs = Aov::ALL.into_iter().collect();
    for (scene, camera) in [scenes::textured(), scenes::in_motion(scenes::room())] {
        let bvh = scene_bvh(&scene, Levels::Auto);
        for integrator in [Integrator::Hybrid, Integrator::Path] {
            let settings = Settings {
                width: 60,
                height: 35,
                samples: 4,
                bounces: 1,
                aovs: all,
                integrator,
                ..Settings::default()
            };
            let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
            let theirs = on_cpu(&scene, &bvh, &camera, &settings);
            // Rays that graze an edge may hit either side of it.
            assert!(apart(&ours, &theirs) < 0.02, "{}", apart(&ours, &theirs));
            let sum = |film: &Film, k: usize| film.guides().iter().map(|guide| guide.tests[k]).sum::<f64>();
            // Both traverse the same nodes, but the device's boxes have slightly more padding.
            for k in 0..2 {
                let (ours, theirs) = (sum(&ours, k), sum(&theirs, k));
                assert!(ours >= 0.9 * theirs && ours <= 1.3 * theirs, "{ours} and {theirs} of kind {k}");
            }
            let other = on_cpu(&scene, &bvh, &camera, &Settings { seed: 1, ..settings });
            assert!(apart(&ours, &other) > 0.1);
            // Only requested guides are recorded, and the light is the same.
            let depth = Settings { aovs: [Aov::Depth].into_iter().collect(), ..settings };
            let fewer = on_device(&gpu, &scene, &bvh, &camera, &depth);
            assert!(fewer.guides().iter().all(|guide| guide.tests == [0.0; 2]));
            assert!(fewer.pixels() == ours.pixels());
        }
    }
}
