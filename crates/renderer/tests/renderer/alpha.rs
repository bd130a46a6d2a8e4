//! Stochastic alpha: blended surfaces let rays pass independently at random.

use std::sync::atomic::AtomicBool;

use canted_lbvh::Strategy;
use canted_renderer::{Accel, Levels, Masked, StructureConfig, Surfaces, Tracer, prepare, render};
use canted_scene::{AlphaMode, Light, Material, Scene};
use canted_trace::{Ray, Watertight};

use crate::common::{BruteForce, camera, floor, grey, scene, settings};

/// Stacked sheets from y = 1 up with the given alphas, over a white floor; a white light shines straight down.
fn sheets(alphas: &[f32]) -> Scene {
    let sheet = |alpha: &f32| Material { alpha_mode: AlphaMode::Blend, alpha: *alpha, ..grey(0.0) };
    let mut meshes = vec![floor(4.0, 0.0, 0)];
    let mut height = 0.0;
    for material in (1..).take(alphas.len()) {
        height += 1.0;
        meshes.push(floor(4.0, height, material));
    }
    let materials = std::iter::once(grey(1.0)).chain(alphas.iter().map(sheet)).collect();
    let sun = Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [std::f32::consts::PI; 3] };
    Scene { lights: vec![sun], ..scene(meshes, materials) }
}

const N: u32 = 40_000;

/// Fraction of `N` rays with independent keys that pass all sheets.
fn passing(scene: &Scene) -> f64 {
    let (tracer, surfaces) = (BruteForce::new(scene), Surfaces::new(scene));
    let all = Masked::new(&surfaces, ());
    let ray = Ray { t_max: 9.5, ..Ray::new([0.3, 10.0, 0.2], [0.0, -1.0, 0.0]) };
    let n = (0..N).filter(|&number| !tracer.occluded(&ray, &mut all.keyed(number))).count();
    n as f64 / f64::from(N)
}

/// Five standard deviations of the mean of `n` independent trials: false alarms have a probability of 1 in two million.
fn bound(fraction: f64, n: f64) -> f64 {
    5.0 * (fraction * (1.0 - fraction) / n).sqrt()
}

#[test]
fn transmittance_is_one_minus_alpha() {
    for alpha in [0.0, 0.1, 0.25, 0.5, 0.9, 1.0] {
        let expected = 1.0 - f64::from(alpha);
        let fraction = passing(&sheets(&[alpha]));
        assert!((fraction - expected).abs() <= bound(expected, f64::from(N)), "{alpha}: {fraction}");
    }
}

#[test]
fn stacked_sheets_are_independent() {
    for alphas in [&[0.5, 0.5][..], &[0.3, 0.6], &[0.5, 0.2, 0.4]] {
        let expected: f64 = alphas.iter().map(|&alpha| 1.0 - f64::from(alpha)).product();
        let fraction = passing(&sheets(alphas));
        assert!((fraction - expected).abs() <= bound(expected, f64::from(N)), "{alphas:?}: {fraction}");
    }
}

#[test]
fn bound_detects_error_of_two_percent() {
    let fraction = passing(&sheets(&[0.5]));
    assert!((fraction - 0.52).abs() > bound(0.52, f64::from(N)));
}

/// Camera rays and shadow rays have independent keys: the pixel is the product of both transmittances.
#[test]
fn camera_and_shadow_rays_are_independent() {
    let (scene, alpha) = (sheets(&[0.4]), 0.4_f64);
    let tracer = BruteForce::new(&scene);
    let view = camera([0.0, 6.0, 0.0], [0.0; 3], 10.0);
    let settings = settings(16, 16, 64, 0);
    let film = render(&scene, &tracer, &view, &settings, &|_, _| (), &AtomicBool::new(false)).unwrap();
    let mean = film.pixels().iter().map(|pixel| pixel.mean()[0]).sum::<f64>() / 256.0;
    // The ray from the floor sees black: sheet or environment.
    let expected = (1.0 - alpha) * (1.0 - alpha);
    assert!((mean - expected).abs() <= bound(expected, 256.0 * 64.0), "{mean} {expected}");
}

#[test]
fn pictures_do_not_depend_on_the_bvh() {
    let scene = sheets(&[0.4, 0.7]);
    let view = camera([1.0, 6.0, 0.5], [0.0; 3], 60.0);
    let settings = settings(24, 16, 4, 1);
    let picture = |config: &StructureConfig| {
        let prepared = prepare::<Watertight>(&scene, config).unwrap();
        let film = render(&scene, &prepared.structure, &view, &settings, &|_, _| (), &AtomicBool::new(false)).unwrap();
        film.picture().pixels
    };
    let first = picture(&StructureConfig { levels: Levels::One, ..StructureConfig::default() });
    for levels in [Levels::One, Levels::Two] {
        let binary = |strategy| Accel::Binary { strategy, builder: None };
        for accel in [Accel::default(), binary(Strategy::Aabb), binary(Strategy::PcaBounded)] {
            let config = StructureConfig { levels, accel };
            assert!(picture(&config) == first, "{config:?}");
        }
    }
}

#[test]
fn alpha_multiplies_material_and_vertex_alpha() {
    let mut scene = sheets(&[0.8]);
    scene.meshes[1].colors = Some(vec![[0.0, 0.0, 0.0, 0.25]; 4]);
    let expected = 1.0 - 0.8 * 0.25;
    assert!((passing(&scene) - expected).abs() <= bound(expected, f64::from(N)));
}
