//! The light at the first surface: with and without what stands between, against closed forms, and against the parts of the light.

use std::f64::consts::{PI, SQRT_2};
use std::sync::atomic::AtomicBool;

use canted_film::{Aov, AovValues, Aovs, Film, Filter};
use canted_renderer::{Integrator, RenderError, Settings, render};
use canted_scene::{Camera, Light, Material, Scene};

use crate::common::{
    BruteForce, box_on_floor, camera, cuboid, film, floor, gray, inside_out, parallelogram, scene, settings, sphere,
    under,
};

/// Settings of a square picture with the light at the first surface.
fn factors(side: u32, samples: u32, bounces: u32) -> Settings {
    let aovs = Aov::FACTORS.into_iter().collect();
    Settings { integrator: Integrator::Hybrid, aovs, ..settings(side, side, samples, bounces) }
}

/// The red channel of an AOV, pixel by pixel.
fn red(film: &Film, aov: Aov) -> Vec<f64> {
    let Some(AovValues::Numbers(numbers)) = film.aov(aov) else { panic!("{aov:?} is not stored") };
    numbers.chunks(3).map(|color| f64::from(color[0])).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// A picture of the origin of the floor with a point light 2 above it.
fn lit(mut stage: Scene) -> Film {
    stage.lights = vec![Light::Point { position: [0.0, 2.0, 0.0], intensity: [3.0; 3] }];
    film(&stage, &camera([0.0, 0.5, 1.0], [0.0; 3], 0.01), &factors(1, 4, 1))
}

/// A Lambertian plane reflects `albedo/π·I/r²` below a point light; a screen takes all of it and changes nothing else.
#[test]
fn a_screen_takes_the_light_and_leaves_what_there_would_be() {
    let screen = parallelogram([-1.0, 1.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], 0);
    let open = scene(vec![floor(5.0, 0.0, 0)], vec![gray(0.6)]);
    let expected = 0.6 / PI * 3.0 / 4.0;
    for (stage, shadow) in [(open.clone(), 1.0), (scene(vec![floor(5.0, 0.0, 0), screen], open.materials), 0.0)] {
        let film = lit(stage);
        let diffuse = red(&film, Aov::Diffuse)[0];
        assert!((diffuse - expected).abs() < 1e-5, "{diffuse} for {expected}");
        assert_eq!(red(&film, Aov::Shadow), [shadow]);
        // The default environment is black where there are lights.
        assert_eq!((red(&film, Aov::Ambient), red(&film, Aov::Occlusion)), (vec![0.0], vec![1.0]));
    }
}

/// A sphere light in front of another light takes its light without a surface.
#[test]
fn lights_stand_in_the_way_of_lights() {
    let mut stage = scene(vec![floor(5.0, 0.0, 0)], vec![gray(0.6)]);
    stage.lights = vec![
        Light::Point { position: [0.0, 2.0, 0.0], intensity: [3.0; 3] },
        Light::Sphere { center: [0.0, 1.0, 0.0], radius: 0.1, radiance: [0.0; 3] },
    ];
    let film = film(&stage, &camera([0.0, 0.5, 1.0], [0.0; 3], 0.01), &factors(1, 4, 1));
    assert!((red(&film, Aov::Diffuse)[0] - 0.6 / PI * 3.0 / 4.0).abs() < 1e-5);
    assert_eq!(red(&film, Aov::Shadow), [0.0]);
}

/// The share of the cosine-weighted hemisphere that a wall of height `h` at distance `d` covers is `(1 - d / √(d² + h²)) / 2`.
#[test]
fn occlusion_beside_a_wall_is_that_of_its_form_factor() {
    const FAR: f32 = 2000.0;
    let wall = |height: f32| parallelogram([-1.0, 0.0, -FAR], [0.0, height, 0.0], [0.0, 0.0, 2.0 * FAR], 0);
    let view = camera([0.5, 1.0, 0.0], [0.0; 3], 0.01);
    for (height, covered) in [(1.0, 0.5 * (1.0 - 1.0 / SQRT_2)), (FAR, 0.5 * (1.0 - 1.0 / f64::from(FAR)))] {
        let stage = under([0.7; 3], scene(vec![floor(FAR, 0.0, 0), wall(height)], vec![gray(0.5)]));
        let film = film(&stage, &view, &factors(8, 256, 1));
        let ambient = red(&film, Aov::Ambient);
        assert!(ambient.iter().all(|x| (x - 0.35).abs() < 1e-6), "{ambient:?}");
        let occlusion = mean(&red(&film, Aov::Occlusion));
        // 16384 samples: four standard deviations are 0.016 at most.
        assert!((occlusion - (1.0 - covered)).abs() < 0.016, "{occlusion} for {}", 1.0 - covered);
    }
}

/// From a point of a sphere, the square of half a chord is uniform for cosine-weighted directions, so the mean of `1 - exp(-t/r)` is
/// `1 - 2 (1 - (1 + k) exp(-k)) / k²` with `k = 2/r`. With a bounce, occluders pass nothing.
#[test]
fn the_ambient_term_of_the_last_bounce_is_part_of_what_arrives() {
    let shell = under([1.0; 3], scene(vec![inside_out(sphere([0.0; 3], 1.0, 3, 0))], vec![gray(0.5)]));
    let view = camera([0.0; 3], [0.0, 0.0, 1.0], 40.0);
    for radius in [1.0_f32, 4.0] {
        let k = 2.0 / f64::from(radius);
        let expected = 1.0 - 2.0 * (1.0 - (1.0 + k) * (-k).exp()) / (k * k);
        for (bounces, want) in [(0, expected), (1, 0.0)] {
            let settings = Settings { ao_radius: Some(radius), ..factors(8, 256, bounces) };
            let film = film(&shell, &view, &settings);
            let occlusion = mean(&red(&film, Aov::Occlusion));
            // Edges of the sphere are within 0.3 % of its radius; the rest is noise.
            assert!((occlusion - want).abs() < 0.01, "{radius}, {bounces}: {occlusion} for {want}");
            assert!((mean(&red(&film, Aov::Ambient)) - 0.5).abs() < 1e-6);
        }
    }
}

/// All kinds of light on a box that emits, in front of a wall.
fn stage() -> (Scene, Camera) {
    let (mut stage, view) = box_on_floor(3.0, 60.0);
    stage.lights.extend([
        Light::Point { position: [-1.0, 2.0, 2.5], intensity: [2.0; 3] },
        Light::Sphere { center: [0.0, 2.2, 0.0], radius: 0.3, radiance: [5.0, 4.0, 3.0] },
        Light::Disk { center: [1.5, 2.5, 0.0], normal: [0.0, -1.0, 0.0], radius: 0.4, radiance: [6.0; 3] },
    ]);
    (under([0.4, 0.6, 0.9], stage), view)
}

/// The greatest difference between the products of the channels and light of the parts, relative to numbers above 1.
fn apart(film: &Film, parts: &[Aov]) -> f64 {
    let values = |aov: Aov| match film.aov(aov) {
        Some(AovValues::Numbers(numbers)) => numbers,
        other => panic!("{aov:?}: {other:?}"),
    };
    let [diffuse, shadow, ambient, occlusion] = Aov::FACTORS.map(values);
    let parts: Vec<Vec<f32>> = parts.iter().map(|&aov| values(aov)).collect();
    let of_value = |i: usize| {
        let sum: f32 = parts.iter().map(|part| part[i]).sum();
        f64::from((diffuse[i] * shadow[i] + ambient[i] * occlusion[i] - sum).abs() / sum.abs().max(1.0))
    };
    (0..diffuse.len()).map(of_value).fold(0.0, f64::max)
}

/// A product of rounded means, and the additions of a sample.
const ROUNDINGS: f64 = 100.0 * f32::EPSILON as f64;

#[test]
fn products_add_up_to_direct_light() {
    let (stage, view) = stage();
    let all: Aovs = Aov::ALL.into_iter().collect();
    let usual = Settings { aovs: all, width: 37, height: 23, ..factors(1, 8, 2) };
    let direct = film(&stage, &view, &usual);
    assert!(apart(&direct, &[Aov::Direct]) < ROUNDINGS, "{}", apart(&direct, &[Aov::Direct]));
    // What is tested is there: shadows, half shadows, and surfaces in the way of the sky.
    for aov in [Aov::Shadow, Aov::Occlusion] {
        let values = red(&direct, aov);
        assert!(values.iter().all(|x| (0.0..=1.0).contains(x)), "{aov:?}");
        assert!(values.iter().filter(|&&x| x > 0.05 && x < 0.95).count() > 20, "{aov:?}: {values:?}");
    }
    for bounces in [1, 5] {
        let settings = Settings { clamp: Some(0.1), bounces, filter: Filter::GAUSSIAN, ..usual };
        let film = film(&stage, &view, &settings);
        assert!(apart(&film, &[Aov::Direct]) < ROUNDINGS, "{}", apart(&film, &[Aov::Direct]));
    }
    // Without bounces, the ambient term is indirect light.
    let without = film(&stage, &view, &Settings { bounces: 0, ao_radius: None, ..usual });
    let both = [Aov::Direct, Aov::Indirect];
    assert!(apart(&without, &both) < ROUNDINGS && apart(&without, &both[..1]) > 1e-3);
    // Pictures do not depend on what is kept.
    let plain = film(&stage, &view, &Settings { aovs: Aovs::NONE, ..usual });
    assert!(plain.pixels() == direct.pixels() && plain.aov(Aov::Shadow).is_none());
    let parts = film(&stage, &view, &Settings { aovs: Aov::COMPONENTS.into_iter().collect(), ..usual });
    assert!(parts.aov(Aov::Direct) == direct.aov(Aov::Direct) && parts.aov(Aov::Diffuse).is_none());
}

/// Emission that the ray finds is direct light of neither kind.
#[test]
fn found_emission_is_in_neither_product() {
    let emissive = Material { emission: [1.0; 3], ..gray(0.5) };
    let room = scene(vec![inside_out(cuboid([-1.0; 3], [1.0, 2.0, 3.0], 0))], vec![emissive]);
    let view = camera([0.1, 0.2, 0.3], [0.5, 0.1, -0.4], 100.0);
    let film = film(&room, &view, &factors(8, 4, 1));
    assert!(red(&film, Aov::Direct).iter().all(|x| (x - 0.5).abs() < 1e-6));
    for (aov, value) in Aov::FACTORS.into_iter().zip([0.0, 1.0, 0.0, 1.0]) {
        assert!(red(&film, aov).iter().all(|&x| x == value), "{aov:?}");
    }
}

/// An infinite light that is occluded leaves the sample, and no number that is not finite.
#[test]
fn infinite_light_that_is_occluded_counts_as_none() {
    let (mut stage, view) = stage();
    let mut below = scene(vec![floor(5.0, 0.0, 0), floor(5.0, 1.0, 0)], vec![gray(0.6)]);
    below.lights = vec![Light::Point { position: [0.0, 2.0, 0.0], intensity: [f32::INFINITY; 3] }];
    let dark = film(&below, &camera([0.0, 0.5, 1.0], [0.0; 3], 0.01), &factors(1, 4, 1));
    assert_eq!((dark.n_dropped(), red(&dark, Aov::Diffuse), red(&dark, Aov::Shadow)), (0, vec![0.0], vec![1.0]));
    // A dropped sample has no light of any kind.
    stage.materials[1].emission = [0.0, f32::NAN, 0.0];
    let aovs = Aov::ALL.into_iter().collect();
    let film = film(&stage, &view, &Settings { aovs, width: 37, height: 23, ..factors(1, 8, 2) });
    assert!(film.n_dropped() > 0 && apart(&film, &[Aov::Direct]) < ROUNDINGS);
}

#[test]
fn the_path_integrator_refuses_by_name() {
    let (stage, view) = stage();
    let settings = Settings { integrator: Integrator::Path, ..factors(4, 1, 1) };
    let error = render(&stage, &BruteForce::new(&stage), &view, &settings, &|_, _| (), &AtomicBool::new(false));
    let error = error.unwrap_err();
    assert_eq!(error, RenderError::Aov { aov: Aov::Diffuse, integrator: Integrator::Path });
    assert_eq!(error.to_string(), "the channel diffuse is not one of the integrator path");
}
