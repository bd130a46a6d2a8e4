//! The light in its parts: closed forms, and the sum of the parts in pictures of everything at once.

use std::f64::consts::PI;

use canted_film::{Aov, Aovs, Components, Film, Filter, Pixel};
use canted_obb::Affine;
use canted_renderer::{Integrator, Pattern, Settings};
use canted_scene::{Camera, Lens, Light, Material, Scene};

use crate::common::{
    box_on_floor, camera, cuboid, film, floor, gray, inside_out, parallelogram, place, scene, settings, sphere, under,
};

/// Settings of a square picture with all parts of the light.
fn parts(integrator: Integrator, side: u32, samples: u32, bounces: u32) -> Settings {
    let aovs = Aov::COMPONENTS.into_iter().collect();
    Settings { integrator, aovs, ..settings(side, side, samples, bounces) }
}

/// The mean of each part over all pixels of one channel, and over the picture.
fn means(film: &Film) -> ([f64; 3], f64) {
    let n = film.pixels().len() as f64;
    let (mut means, mut all) = ([0.0; 3], 0.0);
    for (components, pixel) in film.components().iter().zip(film.pixels()) {
        let of_pixel = components.mean(pixel).sums;
        (0..3).for_each(|part| means[part] += of_pixel[part][0] / n);
        all += pixel.mean()[0] / n;
    }
    (means, all)
}

/// Checks the means of all parts to within a relative error.
#[track_caller]
fn check(scene: &Scene, view: &Camera, settings: &Settings, expected: [f64; 3], precision: f64) {
    let (means, all) = means(&film(scene, view, settings));
    for (mean, want) in means.into_iter().zip(expected) {
        assert!((mean - want).abs() <= precision * want, "{:?}: {means:?} for {expected:?}", settings.integrator);
    }
    assert!((means.iter().sum::<f64>() - all).abs() <= 1e-6 * all, "{means:?} for {all}");
}

/// A Lambertian plane reflects `albedo/π·I·cosθ/r²` of a point light, all of it direct.
#[test]
fn a_point_light_over_a_plane_is_direct() {
    let position = [0.5, 2.0, 0.0];
    let lights = vec![Light::Point { position, intensity: [3.0; 3] }];
    let stage = Scene { lights, ..scene(vec![floor(5.0, 0.0, 0)], vec![gray(0.6)]) };
    let view = camera([0.0, 3.0, 1.0], [0.0; 3], 0.01);
    let square = 0.25 + 4.0_f64;
    let expected = 0.6 / PI * 3.0 * (2.0 / square.sqrt()) / square;
    for integrator in Integrator::ALL {
        check(&stage, &view, &parts(integrator, 1, 4, 3), [0.0, expected, 0.0], 1e-4);
    }
}

/// Inside a closed object that emits 1 and reflects a half, each further bounce halves the light.
#[test]
fn parts_of_a_closed_emitter_are_those_of_the_geometric_series() {
    let emissive = Material { emission: [1.0; 3], ..gray(0.5) };
    let room = scene(vec![inside_out(cuboid([-1.0; 3], [1.0, 2.0, 3.0], 0))], vec![emissive]);
    let view = camera([0.1, 0.2, 0.3], [0.5, 0.1, -0.4], 100.0);
    for (bounces, expected) in [(0, [1.0, 0.0, 0.0]), (1, [1.0, 0.5, 0.0]), (2, [1.0, 0.5, 0.25])] {
        // Each ray of the hybrid integrator hits the same light.
        check(&room, &view, &parts(Integrator::Hybrid, 8, 4, bounces), expected, 1e-6);
        check(&room, &view, &parts(Integrator::Path, 24, 256, bounces), expected, 1e-2);
    }
}

/// A sky of 1 is emission where the camera sees it, and direct light on a plane that covers the view; a lamp in front of it is emission,
/// too.
#[test]
fn the_environment_and_lamps_are_emission_where_the_camera_sees_them() {
    let stage = under([1.0; 3], scene(vec![floor(1000.0, 0.0, 0)], vec![gray(0.5)]));
    let [up, down] = [[0.0, 9.0, 0.0], [0.0; 3]].map(|target| camera([0.0, 5.0, 0.1], target, 10.0));
    let lamp = Light::Sphere { center: [0.0, 9.0, 0.0], radius: 2.0, radiance: [3.0; 3] };
    let lit = Scene { lights: vec![lamp], ..stage.clone() };
    for integrator in Integrator::ALL {
        let settings = parts(integrator, 4, 64, 1);
        check(&stage, &up, &settings, [1.0, 0.0, 0.0], 1e-6);
        check(&stage, &down, &settings, [0.0, 0.5, 0.0], 1e-2);
        check(&lit, &up, &settings, [3.0, 0.0, 0.0], 1e-6);
    }
}

/// The ambient term stands for light of further bounces.
#[test]
fn ambient_light_is_indirect() {
    let stage = under([1.0; 3], scene(vec![inside_out(sphere([0.0; 3], 1.0, 2, 0))], vec![gray(0.5)]));
    let view = camera([0.0; 3], [0.0, 0.0, 1.0], 40.0);
    for bounces in [0, 1] {
        let settings = Settings { ao_radius: Some(1e-6), ..parts(Integrator::Hybrid, 4, 16, bounces) };
        let (means, all) = means(&film(&stage, &view, &settings));
        assert!(all > 0.2 && means == [0.0, 0.0, all], "{means:?} of {all}");
    }
}

/// Mirrors and glass scatter, too: a mirror shows a sky in direct light, and so does a thin pane in front of it; light through a solid is
/// indirect but for what its front reflects.
#[test]
fn mirrors_and_glass_count_as_surfaces() {
    let polished = Material { base_color: [1.0; 3], roughness: 0.0, specular: 1.0, ..Material::default() };
    let mirror = Material { metallic: 1.0, base_color: [0.75; 3], ..polished.clone() };
    let pane = Material { transmission: 1.0, thin_walled: true, ..polished.clone() };
    let solid = Material { transmission: 1.0, ior: 1.5, ..polished };
    let view = camera([0.0, 5.0, 0.1], [0.0; 3], 5.0);
    let wall = |material: Material| under([1.0; 3], scene(vec![floor(10.0, 0.0, 0)], vec![material]));
    let settings = parts(Integrator::Path, 8, 256, 64);
    check(&wall(mirror), &view, &settings, [0.0, 0.75, 0.0], 1e-5);
    check(&wall(pane), &view, &settings, [0.0, 1.0, 0.0], 1e-5);
    // At normal incidence the front reflects 0.04.
    let block = under([1.0; 3], scene(vec![cuboid([-9.0, -1.0, -9.0], [9.0, 0.0, 9.0], 0)], vec![solid]));
    check(&block, &view, &settings, [0.0, 0.04, 0.96], 0.05);
}

/// A mirror, glass, an emissive block and all kinds of lights before a sky.
fn everything() -> (Scene, Camera) {
    let (mut stage, view) = box_on_floor(3.0, 60.0);
    let polished = Material { base_color: [0.9; 3], roughness: 0.0, specular: 1.0, ..Material::default() };
    let kinds = [
        Material { metallic: 1.0, ..polished.clone() },
        Material { transmission: 1.0, ..polished },
        Material { emission: [2.0, 1.0, 0.5], ..gray(0.5) },
    ];
    for (kind, x) in kinds.into_iter().zip([-2.0_f32, 0.5, 2.0]) {
        let material = u32::try_from(stage.materials.len()).unwrap();
        stage.materials.push(kind);
        stage.instances.push(place(u32::try_from(stage.meshes.len()).unwrap(), Affine::IDENTITY));
        stage.meshes.push(cuboid([x, 0.1, 1.0], [x + 0.8, 0.9, 1.8], material));
    }
    let wall = parallelogram([-3.0, 0.0, -2.0], [6.0, 0.0, 0.0], [0.0, 3.0, 0.0], 0);
    stage.instances.push(place(u32::try_from(stage.meshes.len()).unwrap(), Affine::IDENTITY));
    stage.meshes.push(wall);
    stage.lights.extend([
        Light::Point { position: [-1.0, 2.0, 2.5], intensity: [2.0; 3] },
        Light::Sphere { center: [0.0, 2.2, 0.0], radius: 0.3, radiance: [5.0, 4.0, 3.0] },
        Light::Disk { center: [1.5, 2.5, 0.0], normal: [0.0, -1.0, 0.0], radius: 0.4, radiance: [6.0; 3] },
    ]);
    (stage, view)
}

/// The greatest difference between a pixel and the sum of its parts, relative to the sum of the absolute values of its samples.
fn apart(film: &Film) -> f64 {
    assert_eq!(film.components().len(), film.pixels().len());
    let of = |(components, pixel): (&Components, &Pixel)| {
        let [emission, direct, indirect] = components.sums;
        let difference = |k: usize| (emission[k] + direct[k] + indirect[k] - pixel.sum[k]).abs();
        // At least the sum of absolute values (Cauchy-Schwarz).
        let absolute = |k: usize| (f64::from(pixel.n_samples) * pixel.sum_of_squares[k]).sqrt();
        (0..3).map(|k| difference(k) / absolute(k).max(1e-3)).fold(0.0, f64::max)
    };
    film.components().iter().zip(film.pixels()).map(of).fold(0.0, f64::max)
}

/// The roundings of a sample: a hundred additions of `f32`.
const ROUNDINGS: f64 = 100.0 * f32::EPSILON as f64;

#[test]
fn parts_add_up_to_the_picture() {
    let (mut stage, view) = everything();
    let lens = Camera { lens: Some(Lens { radius: 0.1, focus_distance: 4.0 }), ..view };
    let moved = Affine { columns: [[1.0, 0.2, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.3, 0.1, 0.0]] };
    for integrator in Integrator::ALL {
        let usual = Settings { width: 37, height: 23, ..parts(integrator, 1, 8, 4) };
        let plain = Settings { aovs: Aovs::NONE, ..usual };
        let [with, without] = [usual, plain].map(|settings| film(&stage, &view, &settings));
        assert!(with.pixels() == without.pixels() && without.components().is_empty(), "the picture is the same");
        for part in 0..3 {
            let n_lit = with.components().iter().filter(|components| components.sums[part][0] > 0.0).count();
            assert!(n_lit > 30, "{integrator:?}: {n_lit} pixels have part {part}");
        }
        let all = [
            usual,
            Settings { clamp: Some(0.3), ..usual },
            Settings { filter: Filter::MITCHELL, ..usual },
            Settings { noise: Some(0.1), samples: 64, pattern: Pattern::Sobol, ..usual },
            Settings { ao_radius: None, bounces: 0, ..usual },
        ];
        stage.background = None;
        for settings in all {
            for camera in [&view, &lens] {
                let apart = apart(&film(&stage, camera, &settings));
                assert!(apart < ROUNDINGS, "{settings:?}: {apart}");
            }
        }
        stage.background = Some([0.0; 3]);
        let mut moving = stage.clone();
        moving.instances[1].world_from_object_close = Some(moved);
        assert!(apart(&film(&moving, &lens, &usual)) < ROUNDINGS, "in motion before a black background");
    }
}

/// A clamp that cut the picture and not its parts would be found.
#[test]
fn parts_without_the_clamp_are_detected() {
    let (stage, view) = everything();
    let usual = Settings { width: 37, height: 23, ..parts(Integrator::Path, 1, 8, 4) };
    let [limited, free] = [Some(0.3), None].map(|clamp| film(&stage, &view, &Settings { clamp, ..usual }));
    let sums = |film: &Film, pixel: usize| {
        let [a, b, c] = film.components()[pixel].sums;
        a[0] + b[0] + c[0]
    };
    let n = limited.pixels().len();
    let n_apart = (0..n).filter(|&i| (sums(&free, i) - limited.pixels()[i].sum[0]).abs() > 1e-2).count();
    assert!(n_apart > n / 10, "{n_apart} of {n}");
}

/// A sample that is dropped has no parts.
#[test]
fn dropped_samples_have_no_parts() {
    let (mut stage, view) = everything();
    stage.materials[1].emission = [0.0, f32::NAN, 0.0];
    for integrator in Integrator::ALL {
        let film = film(&stage, &view, &Settings { width: 37, height: 23, ..parts(integrator, 1, 8, 2) });
        assert!(film.n_dropped() > 0 && apart(&film) < ROUNDINGS);
    }
}
