//! Rendering: determinism across threads and tiles, invalid samples, progress, cancellation, errors.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use canted_film::{Aovs, Film};
use canted_renderer::{CameraError, RenderError, Settings, environment_of, render};
use canted_scene::{Camera, Light, Material, Projection, Scene};

use crate::common::{BruteForce, camera, cuboid, film, floor, grey, scene, settings};

fn stage() -> (Scene, Camera) {
    let mut stage = scene(
        vec![floor(5.0, 0.0, 0), cuboid([-1.0, 0.0, -1.0], [1.0, 1.5, 0.5], 1)],
        vec![grey(0.8), Material { base_color: [0.9, 0.4, 0.1], ..Material::default() }],
    );
    stage.environment = Some([0.3, 0.4, 0.6].into());
    stage.lights = vec![Light::Sun { direction: [-0.6, -0.8, 0.0], irradiance: [2.0; 3] }];
    (stage, camera([3.0, 3.0, 4.0], [0.0, 0.5, 0.0], 50.0))
}

const SETTINGS: Settings = Settings {
    width: 37,
    height: 23,
    integrator: canted_renderer::Integrator::Hybrid,
    samples: 5,
    bounces: 2,
    seed: 9,
    pattern: canted_renderer::Pattern::Stratified,
    filter: canted_film::Filter::BOX,
    lod: canted_renderer::Lod::Aniso,
    energy_compensation: true,
    ao_radius: None,
    means_only: false,
    sums: canted_renderer::SampleSums::Host,
    tile: 32,
    part: None,
    noise: None,
    aovs: Aovs::NONE,
};

#[test]
fn threads_and_tiles_do_not_change_the_image() {
    let (stage, view) = stage();
    let with = |threads, tile| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| film(&stage, &view, &Settings { tile, ..SETTINGS }))
    };
    let reference = with(1, 1);
    for (threads, tile) in [(1, 32), (2, 8), (3, 7), (5, 1000), (2, u32::MAX), (2, 0)] {
        assert_eq!(with(threads, tile), reference, "{threads} threads, tiles of {tile}");
    }
    assert_ne!(film(&stage, &view, &Settings { seed: 10, ..SETTINGS }), reference, "the seed has an effect");
}

/// Ray counts: on a bare plane each sample traces a camera ray, a shadow ray and a bounce.
#[test]
fn rays_are_counted() {
    let mut plane = scene(vec![floor(100.0, 0.0, 0)], vec![grey(0.5)]);
    let view = camera([0.0, 5.0, 5.0], [0.0; 3], 20.0);
    assert_eq!(film(&plane, &view, &settings(4, 4, 3, 2)).n_rays(), 4 * 4 * 3 * 2);
    plane.lights = vec![Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] }];
    assert_eq!(film(&plane, &view, &settings(4, 4, 3, 2)).n_rays(), 4 * 4 * 3 * 3);
}

/// A material with NaN values affects only the samples that hit it.
#[test]
fn invalid_samples_are_dropped() {
    let poison = |emission| {
        let (mut stage, view) = stage();
        stage.materials[1].emission = [0.0, emission, 0.0];
        film(&stage, &view, &SETTINGS)
    };
    let clean = poison(0.0);
    assert_eq!((clean.n_dropped(), clean.first_dropped()), (0, None));
    for emission in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let film = poison(emission);
        assert!(film.n_dropped() > 0);
        // The first of them in scanline order is reported.
        let [x, y] = film.first_dropped().unwrap();
        let (before, from) = film.pixels().split_at((y * SETTINGS.width + x) as usize);
        assert!(x < SETTINGS.width && from[0].n_dropped > 0 && before.iter().all(|pixel| pixel.n_dropped == 0));
        let (mut n_partly, mut n_same) = (0, 0);
        for (pixel, clean) in film.pixels().iter().zip(clean.pixels()) {
            assert_eq!(pixel.n_samples + pixel.n_dropped, SETTINGS.samples);
            assert!(pixel.mean().iter().all(|x| x.is_finite()));
            if pixel.n_dropped == 0 {
                assert_eq!(pixel, clean);
                n_same += 1;
            } else if pixel.n_samples > 0 {
                n_partly += 1;
            }
        }
        assert!(n_same > 100 && n_partly > 10, "{n_same} {n_partly}");
    }
}

#[test]
fn progress_counts_every_tile_once() {
    let (stage, view) = stage();
    let heard = Mutex::new(Vec::new());
    let tell = |done, all| heard.lock().unwrap().push((done, all));
    let settings = Settings { tile: 8, ..SETTINGS };
    render(&stage, &BruteForce::new(&stage), &view, &settings, &tell, &AtomicBool::new(false)).unwrap();
    let mut heard = heard.into_inner().unwrap();
    heard.sort_unstable();
    assert_eq!(heard, (1..=15).map(|done| (done, 15)).collect::<Vec<_>>());
}

#[test]
fn cancelling_stops_the_work() {
    let (stage, view) = stage();
    let cancel = AtomicBool::new(false);
    let n_heard = std::sync::atomic::AtomicUsize::new(0);
    let stop_at_once = |_, _| {
        n_heard.fetch_add(1, Ordering::Relaxed);
        cancel.store(true, Ordering::Relaxed);
    };
    let settings = Settings { tile: 1, ..SETTINGS };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let result = pool.install(|| render(&stage, &BruteForce::new(&stage), &view, &settings, &stop_at_once, &cancel));
    assert_eq!(result, Err(RenderError::Cancelled));
    // Each thread may have had a tile in progress.
    assert!(n_heard.load(Ordering::Relaxed) <= 2);
}

#[test]
fn invalid_settings_are_rejected() {
    let (stage, view) = stage();
    let refused = |settings: Settings, view: &Camera| -> RenderError {
        let result: Result<Film, _> =
            render(&stage, &BruteForce::new(&stage), view, &settings, &|_, _| (), &AtomicBool::new(false));
        result.unwrap_err()
    };
    assert_eq!(refused(Settings { width: 0, ..SETTINGS }, &view), RenderError::Size { width: 0, height: 23 });
    let huge = RenderError::Size { width: 1 << 17, height: 1 << 17 };
    assert_eq!(refused(Settings { width: 1 << 17, height: 1 << 17, ..SETTINGS }, &view), huge);
    assert_eq!(refused(Settings { samples: 0, ..SETTINGS }, &view), RenderError::NoSamples);
    for radius in [0.0, -1.0] {
        let error = refused(Settings { ao_radius: Some(radius), ..SETTINGS }, &view);
        assert_eq!(error.to_string(), format!("ambient occlusion radius {radius} is not above zero"));
    }
    assert!(matches!(refused(Settings { ao_radius: Some(f32::NAN), ..SETTINGS }, &view), RenderError::AoRadius { .. }));
    let filter = canted_film::Filter::Gaussian(-1.0);
    let error = refused(Settings { filter, ..SETTINGS }, &view);
    assert_eq!(error.to_string(), "pixel filter radius -1 is not finite and above zero");
    let blind = Camera { projection: Projection::Perspective { fov_degrees: 0.0 }, ..view };
    assert_eq!(refused(SETTINGS, &blind), RenderError::Camera(CameraError::FieldOfView { degrees: 0.0 }));
}

#[test]
fn empty_scene_shows_its_environment() {
    let empty = Scene { environment: Some([0.25, 0.5, 0.75].into()), ..Scene::default() };
    let film = film(&empty, &camera([0.0; 3], [0.0, 0.0, -1.0], 40.0), &SETTINGS);
    assert!(film.picture().pixels.iter().all(|&pixel| pixel == [0.25, 0.5, 0.75]));
}

#[test]
fn default_environment_is_white_only_without_other_lights() {
    let bare = Scene::default();
    assert_eq!(*environment_of(&bare), [1.0; 3].into());
    let lit = Scene { lights: vec![Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] }], ..bare.clone() };
    assert_eq!(*environment_of(&lit), [0.0; 3].into());
    let emissive = Scene { materials: vec![Material { emission: [1.0, 0.0, 0.0], ..grey(0.5) }], ..bare.clone() };
    assert_eq!(*environment_of(&emissive), [0.0; 3].into());
    assert_eq!(*environment_of(&Scene { environment: Some([0.5; 3].into()), ..lit }), [0.5; 3].into());
}
