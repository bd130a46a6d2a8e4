//! The light in its parts on the device: their sum, and each compared with that of the CPU.

use canted_film::{Aov, Aovs, Components, Film, Filter};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{Cull, Integrator, Levels, SampleSums, Settings};
use canted_scene::{Camera, Light, Scene};

use crate::{
    gpu,
    paths::of_all_materials,
    scenes::{self, on_cpu, on_device, scene_bvh},
    sums::summed,
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(parts_add_up_and_are_those_of_the_cpu),
        needs_device(light_at_the_first_surface_is_that_of_the_cpu),
        needs_device(the_picture_is_the_same_with_and_without_parts),
        needs_device(the_cpu_takes_parts_of_unfinished_samples),
        needs_device(dropped_samples_have_no_parts),
    ]
}

fn settings(integrator: Integrator) -> Settings {
    let aovs = Aov::COMPONENTS.into_iter().collect();
    Settings { width: 48, height: 27, samples: 4, integrator, bounces: 3, aovs, ..Settings::default() }
}

/// The roundings of a sample, and of the device's sums: a hundred additions of `f32`.
const ROUNDINGS: f64 = 100.0 * f32::EPSILON as f64;

/// The greatest difference between a pixel and the sum of its parts, relative to the sum of the absolute values of its samples.
fn apart(film: &Film) -> f64 {
    assert_eq!(film.components().len(), film.pixels().len());
    let mut greatest = 0.0_f64;
    for (components, pixel) in film.components().iter().zip(film.pixels()) {
        let [emission, direct, indirect] = components.sums;
        for k in 0..3 {
            let difference = (emission[k] + direct[k] + indirect[k] - pixel.sum[k]).abs();
            // At least the sum of absolute values (Cauchy-Schwarz).
            let absolute = (f64::from(pixel.n_samples) * pixel.sum_of_squares[k]).sqrt();
            greatest = greatest.max(difference / absolute.max(1e-3));
        }
    }
    greatest
}

/// The share of pixels in which a part differs from one of another film by more than rounding explains, and the relative difference of the means.
fn difference(ours: &Film, theirs: &Film, parts: [usize; 2]) -> (f64, f64) {
    let (mut n_astray, mut sums) = (0, [0.0; 2]);
    let all = ours.components().iter().zip(ours.pixels()).zip(theirs.components().iter().zip(theirs.pixels()));
    for ((ours, our_pixel), (theirs, their_pixel)) in all {
        let (a, b) = (ours.mean(our_pixel).sums[parts[0]], theirs.mean(their_pixel).sums[parts[1]]);
        n_astray += u32::from((0..3).any(|k| (a[k] - b[k]).abs() > scenes::ROUNDING * (b[k].abs() + 0.05)));
        sums[0] += a.iter().sum::<f64>();
        sums[1] += b.iter().sum::<f64>();
    }
    assert!(sums[1] > 0.0, "there is light in part {}", parts[1]);
    (f64::from(n_astray) / theirs.pixels().len() as f64, (sums[0] / sums[1] - 1.0).abs())
}

fn parts_add_up_and_are_those_of_the_cpu() {
    let gpu = gpu();
    let before_a_sky = of_all_materials();
    let mut lit = scenes::in_motion(scenes::room());
    lit.0.background = Some([0.9, 0.1, 0.4]);
    for (name, (scene, camera)) in [("all materials", before_a_sky), ("motion before a background", lit)] {
        let bvh = scene_bvh(&scene, Levels::Auto);
        for integrator in Integrator::ALL {
            let usual = settings(integrator);
            let theirs = on_cpu(&scene, &bvh, &camera, &usual);
            let ours = on_device(&gpu, &scene, &bvh, &camera, &usual);
            assert!(apart(&ours) < ROUNDINGS, "{name}, {integrator:?}: {}", apart(&ours));
            for part in 0..3 {
                let (astray, of_means) = difference(&ours, &theirs, [part; 2]);
                assert!(astray < 0.4 && of_means < 0.02, "{name}, {integrator:?}, part {part}: {astray}, {of_means}");
            }
            assert!(difference(&ours, &theirs, [1, 2]).0 > 0.5, "{name}, {integrator:?}: parts differ");
        }
    }
    let (scene, camera) = of_all_materials();
    let bvh = scene_bvh(&scene, Levels::One);
    for integrator in Integrator::ALL {
        let usual = Settings { width: 21, height: 13, ..settings(integrator) };
        for settings in [
            Settings { clamp: Some(0.2), cull: Cull::Back, filter: Filter::MITCHELL, ..usual },
            Settings { sums: SampleSums::Device, samples: 70, bounces: 0, ..usual },
        ] {
            let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
            assert!(apart(&ours) < ROUNDINGS, "{settings:?}: {}", apart(&ours));
        }
    }
}

/// The greatest difference between direct light and what arrives at the first surface, relative to the sum of the pixel; without emission.
fn apart_from_direct(film: &Film) -> f64 {
    let of_pixel = |components: &Components| {
        let [_, shadowed, _, occluded] = components.first.unwrap_or_default();
        let [_, direct, _] = components.sums;
        let difference = |k: usize| (shadowed[k] + occluded[k] - direct[k]).abs() / direct[k].abs().max(1e-3);
        (0..3).map(difference).fold(0.0, f64::max)
    };
    film.components().iter().map(of_pixel).fold(0.0, f64::max)
}

/// Pixels in which one of the four sums at the first surface differs by more than rounding explains, as a share, and the greatest
/// relative difference of a mean over the picture.
fn difference_at_first(ours: &Film, theirs: &Film) -> (f64, f64) {
    let (mut n_astray, mut sums) = (0, [[0.0; 2]; 4]);
    for (ours, theirs) in ours.components().iter().zip(theirs.components()) {
        let [a, b] = [ours, theirs].map(|components| components.first.unwrap());
        let is_apart = |(a, b): (&f64, &f64)| (a - b).abs() > scenes::ROUNDING * (b.abs() + 0.05);
        n_astray += u32::from(a.as_flattened().iter().zip(b.as_flattened()).any(is_apart));
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(&b)) {
            *sum = [sum[0] + a.iter().sum::<f64>(), sum[1] + b.iter().sum::<f64>()];
        }
    }
    assert!(sums.iter().all(|[_, theirs]| *theirs > 0.0), "{sums:?}");
    let of_means = sums.iter().map(|[ours, theirs]| (ours / theirs - 1.0).abs()).fold(0.0, f64::max);
    (f64::from(n_astray) / theirs.pixels().len() as f64, of_means)
}

fn light_at_the_first_surface_is_that_of_the_cpu() {
    let gpu = gpu();
    let mut dark = scenes::room();
    dark.0.materials.iter_mut().for_each(|material| material.emission = [0.0; 3]);
    for (name, (scene, camera), bounces, sums) in [
        ("in motion, the last bounce", scenes::in_motion(scenes::room()), 0, SampleSums::Host),
        ("without emission", dark, 2, SampleSums::Device),
    ] {
        let bvh = scene_bvh(&scene, Levels::Auto);
        let settings = Settings { bounces, sums, aovs: Integrator::Hybrid.aovs(), ..settings(Integrator::Hybrid) };
        let theirs = on_cpu(&scene, &bvh, &camera, &settings);
        let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
        let (astray, of_means) = difference_at_first(&ours, &theirs);
        assert!(astray < 0.1 && of_means < 0.02, "{name}: {astray}, {of_means}");
        let other = on_cpu(&scene, &bvh, &camera, &Settings { seed: 1, ..settings });
        assert!(difference_at_first(&other, &theirs).0 > 0.3, "{name}: samples differ");
        if bounces > 0 {
            for film in [&ours, &theirs] {
                assert!(apart_from_direct(film) < ROUNDINGS, "{name}: {}", apart_from_direct(film));
            }
            let depth = Aovs::NONE.with(Aov::Depth);
            let plain = on_device(&gpu, &scene, &bvh, &camera, &Settings { aovs: depth, ..settings });
            assert!(ours.pixels() == plain.pixels(), "{name}: the picture is the same");
        }
    }
}

fn the_picture_is_the_same_with_and_without_parts() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for integrator in Integrator::ALL {
        let with = settings(integrator);
        let without = Settings { aovs: Aovs::NONE.with(Aov::Depth), ..with };
        let [ours, plain] = [with, without].map(|settings| on_device(&gpu, &scene, &bvh, &camera, &settings));
        assert!(ours.pixels() == plain.pixels() && plain.components().is_empty(), "the picture is the same");
    }
}

fn the_cpu_takes_parts_of_unfinished_samples() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for integrator in Integrator::ALL {
        let settings = Settings { aovs: integrator.aovs(), filter: Filter::MITCHELL, ..settings(integrator) };
        let theirs = on_cpu(&scene, &bvh, &camera, &settings);
        let limited = |sums, n| {
            let settings = Settings { sums, ..settings };
            summed(&gpu, (&scene, &camera), &bvh, &settings, |traced| traced.with_max_iterations(n))
        };
        let [[none, some], [none_of_host, some_of_host]] =
            [SampleSums::Device, SampleSums::Host].map(|sums| [0, 100].map(|n| limited(sums, n)));
        assert!(none.components() == theirs.components() && none == none_of_host);
        assert!(some.components() != theirs.components() && some == some_of_host && apart(&some) < ROUNDINGS);
    }
}

/// Whether there is light in each part.
pub(crate) fn has_light(film: &Film) -> bool {
    let in_part = |part: usize| film.components().iter().any(|components| components.sums[part] != [0.0; 3]);
    (0..3).all(in_part)
}

/// Boxes that reflect `1e21` of the brightest sun that a device supports, up to `3e38`, and as much of what the walls reflect to them: in many
/// samples each part is an `f32`, and their sum is not.
pub(crate) fn too_bright() -> (Scene, Camera) {
    let (mut scene, camera) = scenes::room();
    scene.materials[1].base_color = [1e21, 0.2, 0.1];
    scene.lights = vec![Light::Sun { direction: [0.6, -0.48, -0.64], irradiance: [1e18; 3] }];
    (scene, camera)
}

fn dropped_samples_have_no_parts() {
    let gpu = gpu();
    let (scene, camera) = too_bright();
    let bvh = scene_bvh(&scene, Levels::One);
    for integrator in Integrator::ALL {
        for sums in SampleSums::ALL {
            let settings = Settings { sums, ..settings(integrator) };
            let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
            let n_taken = u64::from(settings.width * settings.height * settings.samples);
            let n_dropped = ours.n_dropped();
            assert!(n_dropped > n_taken / 100 && n_dropped < n_taken / 2, "{integrator:?}: {n_dropped} of {n_taken}");
            assert!(has_light(&ours) && apart(&ours) < ROUNDINGS, "{integrator:?}, {sums:?}: {}", apart(&ours));
        }
    }
}
