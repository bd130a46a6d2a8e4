//! The path integrator compared with closed forms, and with the hybrid integrator where both compute the same light.

use canted_film::Film;
use canted_renderer::{Integrator, Settings};
use canted_scene::{Camera, Light, Material, Scene};

use crate::common::{U, camera, cuboid, film, floor, grey, inside_out, scene, settings, sphere};

/// Allowed deviation of a mean in standard deviations: one false alarm in ten million.
const SIGMAS: f64 = 5.3;

fn paths(n: u32, samples: u32, bounces: u32) -> Settings {
    Settings { integrator: Integrator::Path, ..settings(n, n, samples, bounces) }
}

/// Mean over all pixels of each channel, with the standard deviation from the spread of the samples.
fn mean_of(film: &Film) -> ([f64; 3], [f64; 3]) {
    assert_eq!(film.n_dropped(), 0);
    let n = film.pixels().len() as f64;
    let mut mean = [0.0; 3];
    let mut variance = [0.0; 3];
    for pixel in film.pixels() {
        let (m, v) = (pixel.mean(), pixel.variance_of_mean());
        for k in 0..3 {
            mean[k] += m[k] / n;
            variance[k] += v[k] / (n * n);
        }
    }
    (mean, variance.map(f64::sqrt))
}

/// Checks that the mean of an image is `expected` in every channel to within its noise, which is at most `precision` of
/// it.
#[track_caller]
fn check(scene: &Scene, view: &Camera, settings: &Settings, expected: f64, precision: f64) {
    let (mean, deviation) = mean_of(&film(scene, view, settings));
    for k in 0..3 {
        assert!(SIGMAS * deviation[k] <= precision * expected, "too noisy: {deviation:?} of {mean:?}");
        // A hundred roundings of f32 in addition to the noise.
        let bound = SIGMAS * deviation[k] + 100.0 * f64::from(f32::EPSILON) * expected;
        assert!((mean[k] - expected).abs() <= bound, "{mean:?} ± {deviation:?} for {expected}");
    }
}

fn white_sky(object: canted_scene::Mesh, material: Material) -> Scene {
    let mut scene = scene(vec![object], vec![material]);
    scene.environment = Some([1.0; 3].into());
    scene
}

#[test]
fn convex_object_in_a_white_furnace_shows_its_albedo() {
    let view = camera([2.0, 3.0, 4.0], [0.0; 3], 15.0);
    for albedo in [1.0, 0.625] {
        let furnace = white_sky(sphere([0.0; 3], 1.0, 3, 0), grey(albedo));
        for bounces in [0, 1, 32] {
            check(&furnace, &view, &paths(16, 64, bounces), f64::from(albedo), 2e-3);
        }
    }
}

/// Shading normals that differ from the geometric normals lose no energy and let no ray into the object.
#[test]
fn smooth_normals_conserve_energy() {
    let mut object = sphere([0.0; 3], 1.0, 1, 0);
    object.normals = Some(object.positions.clone());
    let furnace = white_sky(object, grey(0.75));
    check(&furnace, &camera([2.0, 3.0, 4.0], [0.0; 3], 10.0), &paths(16, 256, 8), 0.75, 2e-3);
}

/// Inside a closed object that emits 1 and reflects `a`, `b` bounces give `1 + a + ... + a^b`.
#[test]
fn closed_emitter_gives_the_geometric_series() {
    let emissive = Material { emission: [1.0; 3], ..grey(0.5) };
    for shell in [inside_out(sphere([0.0; 3], 1.0, 2, 0)), cuboid([-1.0; 3], [1.0, 2.0, 3.0], 0)] {
        // The environment would be visible through any leak.
        let mut room = scene(vec![shell], vec![emissive.clone()]);
        room.environment = Some([100.0; 3].into());
        let view = camera([0.1, 0.2, 0.3], [0.5, 0.1, -0.4], 100.0);
        for (bounces, expected) in [(0, 1.0), (1, 1.5), (2, 1.75), (5, 1.968_75), (64, 2.0)] {
            check(&room, &view, &paths(12, 128, bounces), expected, 1e-2);
        }
    }
}

/// A closed object of clear glass under a constant environment is invisible.
#[test]
fn clear_glass_conserves_energy() {
    let glass = Material { base_color: [1.0; 3], roughness: 0.0, specular: 1.0, transmission: 1.0, ..grey(1.0) };
    let view = camera([2.0, 3.0, 4.0], [0.0; 3], 25.0);
    for (ior, object) in [(1.5, sphere([0.0; 3], 1.0, 3, 0)), (2.4, cuboid([-1.0; 3], [1.0; 3], 0))] {
        let furnace = white_sky(object.clone(), Material { ior, ..glass.clone() });
        check(&furnace, &view, &paths(12, 128, 4096), 1.0, 2e-2);
        let sheet = white_sky(object, Material { ior, thin_walled: true, ..glass.clone() });
        check(&sheet, &view, &paths(12, 128, 4096), 1.0, 2e-2);
    }
}

/// Reflectance, throughput, environment radiance and filter weight round once each. At normal incidence Schlick's term
/// is below the fifth power of the field of view and adds nothing.
const MIRRORED_ERROR: f64 = 4.0 * U;

/// A polished metal under a constant environment shows its reflectance, up to white at grazing angles.
#[test]
fn mirror_shows_its_reflectance() {
    let metal = Material { metallic: 1.0, roughness: 0.0, ..grey(0.5) };
    let (mean, _) =
        mean_of(&film(&white_sky(floor(1.0, 0.0, 0), metal), &camera([0.0, 5.0, 0.0], [0.0; 3], 1.0), &paths(4, 4, 8)));
    assert!(mean.iter().all(|x| (x / 0.5 - 1.0).abs() <= MIRRORED_ERROR), "{mean:?}");
}

/// For Lambertian surfaces without the ambient term, both integrators compute the same light.
#[test]
fn path_and_hybrid_agree_on_lambertian_surfaces() {
    let bodies = vec![
        floor(5.0, 0.0, 0),
        cuboid([-1.0, 0.0, -1.0], [0.0, 2.0, 0.0], 1),
        sphere([1.0, 0.5, 0.5], 0.5, 2, 2),
        floor(0.5, 3.0, 3),
    ];
    let lamp = Material { emission: [4.0, 3.0, 2.0], ..grey(0.5) };
    let mut stage = scene(bodies, vec![grey(0.5), grey(0.8), grey(0.3), lamp]);
    stage.environment = Some([0.3, 0.4, 0.6].into());
    stage.lights = vec![
        Light::Sun { direction: [0.0, -0.6, 0.8], irradiance: [1.0, 0.9, 0.8] },
        Light::Point { position: [2.0, 2.0, 2.0], intensity: [3.0; 3] },
    ];
    let view = camera([4.0, 3.0, 5.0], [0.0, 0.5, 0.0], 40.0);
    for bounces in [0, 1, 3] {
        let (path, path_deviation) = mean_of(&film(&stage, &view, &paths(16, 256, bounces)));
        let hybrid = Settings { integrator: Integrator::Hybrid, ..paths(16, 512, bounces) };
        let (hybrid, hybrid_deviation) = mean_of(&film(&stage, &view, &hybrid));
        for k in 0..3 {
            let bound = SIGMAS * path_deviation[k].hypot(hybrid_deviation[k]);
            assert!(bound < 0.02 * path[k], "too noisy");
            assert!((path[k] - hybrid[k]).abs() < bound, "{bounces}: {path:?} and {hybrid:?} ± {bound}");
        }
    }
}

/// The test above detects missing light.
#[test]
#[should_panic(expected = "for 0.625")]
fn test_detects_missing_light() {
    let furnace = white_sky(sphere([0.0; 3], 1.0, 3, 0), grey(0.62));
    check(&furnace, &camera([2.0, 3.0, 4.0], [0.0; 3], 15.0), &paths(16, 64, 1), 0.625, 2e-3);
}
