//! Environment maps: orientation, lookups, sampling.

use std::f64::consts::{PI, TAU};

use canted_renderer::{LightId, Lights, environment_of};
use canted_scene::{EnvironmentImage, Scene};
use canted_trace::Ray;

use super::{irradiance, numbers, receiver, with_sampler};
use crate::common::{U, Vector, dot, narrow, scene};

/// A dim environment map with a single bright texel, like a sun.
pub(super) fn sunny(turn_degrees: f32) -> EnvironmentImage {
    let (width, height) = (16, 8);
    let dim = |i: u32| [0.2 + 0.01 * (i % 7) as f32, 0.3, 0.4];
    let mut texels: Vec<[f32; 3]> = (0..width * height).map(dim).collect();
    texels[2 * 16 + 15] = [80.0, 70.0, 60.0];
    EnvironmentImage { name: "sunny".into(), width, height, texels, scale: [2.0, 1.0, 0.5], turn_degrees }
}

pub(super) fn under(image: EnvironmentImage) -> Scene {
    Scene { environment: Some(canted_scene::Environment::Image(image)), ..scene(vec![], vec![]) }
}

/// Red radiance, implemented independently: bilinear between texel centers.
fn radiance(image: &EnvironmentImage, [x, y, z]: Vector) -> f64 {
    let turn = f64::from(image.turn_degrees) / 360.0;
    let u = ((x.atan2(-z) / TAU + 0.5 + turn).rem_euclid(1.0)) * f64::from(image.width) - 0.5;
    let v = (y.clamp(-1.0, 1.0).acos() / PI) * f64::from(image.height) - 0.5;
    let mut sum = 0.0;
    for (i, a) in [(u.floor(), 1.0 - (u - u.floor())), (u.floor() + 1.0, u - u.floor())] {
        for (j, b) in [(v.floor(), 1.0 - (v - v.floor())), (v.floor() + 1.0, v - v.floor())] {
            let (i, j) =
                (i.rem_euclid(f64::from(image.width)) as usize, j.clamp(0.0, f64::from(image.height) - 1.0) as usize);
            sum += a * b * f64::from(image.texels[j * image.width as usize + i][0]);
        }
    }
    sum * f64::from(image.scale[0])
}

fn lookup(scene: &Scene, direction: [f32; 3]) -> [f32; 3] {
    let hit = Lights::new(scene).intersect(&Ray::new([5.0, -3.0, 2.0], direction), None).unwrap();
    assert_eq!(hit.light, LightId::Environment);
    hit.radiance
}

/// The center of the image is -z, right of it +x, the top +y. A rotation is counter-clockwise from above.
#[test]
fn orientation_matches_convention() {
    let marked = |column: usize, row: usize, turn_degrees| {
        let mut image = EnvironmentImage { turn_degrees, ..sunny(0.0) };
        image.texels = vec![[0.0; 3]; 128];
        // Four texels around a corner have equal weights there.
        for (i, j) in [(column + 15, row - 1), (column, row - 1), (column + 15, row), (column, row)] {
            image.texels[j * 16 + i % 16] = [0.5, 1.0, 2.0];
        }
        under(image)
    };
    for (column, direction) in
        [(8, [0.0, 0.0, -3.0]), (12, [2.0, 0.0, 0.0]), (0, [0.0, 0.0, 0.1]), (4, [-1.0, 0.0, 0.0])]
    {
        assert_eq!(lookup(&marked(column, 4, 0.0), direction), [1.0; 3], "column {column}");
        assert_eq!(lookup(&marked(column, 4, 0.0), direction.map(|x| -x)), [0.0; 3], "column {column}");
    }
    // A rotation by 90 degrees moves -z to -x.
    assert_eq!(lookup(&marked(8, 4, 90.0), [-1.0, 0.0, 0.0]), [1.0; 3]);
    assert_eq!(lookup(&marked(8, 4, -90.0), [1.0, 0.0, 0.0]), [1.0; 3]);
    let poles = under(EnvironmentImage {
        texels: (0..128).map(|i| if i < 16 { [1.0; 3] } else { [0.0; 3] }).collect(),
        scale: [1.0; 3],
        ..sunny(0.0)
    });
    assert_eq!((lookup(&poles, [0.0, 1.0, 0.0]), lookup(&poles, [0.0, -1.0, 0.0])), ([1.0; 3], [0.0; 3]));
    assert_eq!(lookup(&poles, [1e-20, 1e-3, 0.0]), [1.0; 3]);
}

#[test]
fn lookups_are_bilinear() {
    for turn in [0.0, 77.0, -500.0] {
        let image = sunny(turn);
        let scene = under(image.clone());
        for (choice, [a, b]) in numbers(1000) {
            let direction = [a - 0.5, b - 0.5, choice - 0.5];
            let wide = direction.map(f64::from);
            let expected = radiance(&image, wide.map(|x| x / dot(wide, wide).sqrt()));
            // The slope is up to 160 per texel; the tolerance is a few roundings of angle and weight.
            assert!((f64::from(lookup(&scene, direction)[0]) - expected).abs() < 1e-4, "{direction:?}");
        }
    }
}

/// Radiance, selection probability and sample round once each. Rounding of the direction changes the cosine relative to
/// itself, which is two roundings in the cosine-weighted mean.
const CONSTANT_ERROR: f64 = 5.0 * U;

/// On an unoccluded plane, every sample of a constant environment is π times its radiance.
#[test]
fn constant_environment_is_sampled_without_noise() {
    let sky = Scene { environment: Some([3.0, 2.0, 1.0].into()), ..scene(vec![], vec![]) };
    let normal = [0.6, 0.0, 0.8];
    let estimate = irradiance(&sky, &receiver([1.0; 3], normal), 1000);
    let bound = 3.0 * PI * CONSTANT_ERROR;
    assert!((estimate.mean - 3.0 * PI).abs() <= bound && estimate.error <= bound, "{estimate:?}");
}

/// Midpoint rule over the hemisphere around a normal.
fn quadrature(image: &EnvironmentImage, normal: Vector) -> f64 {
    const ROWS: u32 = 800;
    let mut sum = 0.0;
    for j in 0..ROWS {
        let (sine, y) = (PI * (f64::from(j) + 0.5) / f64::from(ROWS)).sin_cos();
        for i in 0..2 * ROWS {
            let (s, c) = (PI * (f64::from(i) + 0.5) / f64::from(ROWS)).sin_cos();
            let direction = [sine * c, y, sine * s];
            sum += radiance(image, direction) * dot(direction, normal).max(0.0) * sine;
        }
    }
    sum * (PI / f64::from(ROWS)).powi(2)
}

#[test]
fn image_irradiance_matches_quadrature() {
    for (turn, normal) in [(0.0, [0.0, 1.0, 0.0]), (77.0, [0.6, 0.0, 0.8]), (200.0, [0.0, -0.6, 0.8])] {
        let image = sunny(turn);
        let expected = quadrature(&image, normal);
        let estimate = irradiance(&under(image), &receiver([0.0; 3], normal), 100_000);
        // The quadrature has a second-order error at the kinks of the bilinear image and at the horizon.
        assert!(
            (estimate.mean - expected).abs() < 5.0 * estimate.error + 1e-4 * expected,
            "{turn}: {estimate:?} {expected}"
        );
    }
}

/// The ambient radiance is the mean over all directions, compared with quadrature.
#[test]
fn ambient_is_the_mean_radiance() {
    let image = sunny(30.0);
    let mut sum = 0.0;
    const ROWS: u32 = 400;
    for j in 0..ROWS {
        let (sine, y) = (PI * (f64::from(j) + 0.5) / f64::from(ROWS)).sin_cos();
        for i in 0..2 * ROWS {
            let (s, c) = (PI * (f64::from(i) + 0.5) / f64::from(ROWS)).sin_cos();
            sum += radiance(&image, [sine * c, y, sine * s]) * sine;
        }
    }
    let expected = sum * (PI / f64::from(ROWS)).powi(2) / (4.0 * PI);
    let ambient = f64::from(Lights::new(&under(image)).ambient()[0]);
    // The mean assumes a constant solid angle within a texel: a second-order error in the texel size.
    assert!((ambient / expected - 1.0).abs() < 0.02, "{ambient} {expected}");
}

/// Most samples point to the sun although it covers a hundredth of the sky. A black image yields no samples.
#[test]
fn sun_in_the_image_is_importance_sampled() {
    with_sampler(&under(sunny(0.0)), |sampler| {
        let from = receiver([0.0; 3], [0.0, 1.0, 0.0]);
        let bright = numbers(1000).filter(|&(choice, square)| {
            let sample = sampler.sample(&from, false, choice, square).unwrap();
            sampler.lights().intersect(&Ray::new([0.0; 3], sample.to_light), None).unwrap().radiance[0] > 2.0
        });
        assert!(bright.count() > 500);
    });
    let black = EnvironmentImage { texels: vec![[0.0; 3]; 128], ..sunny(0.0) };
    assert_eq!(irradiance(&under(black), &receiver([0.0; 3], [0.0, 1.0, 0.0]), 10).mean, 0.0);
}

/// With a single bright texel, all directions with positive bilinear radiance have a positive PDF.
#[test]
fn every_bright_direction_has_positive_pdf() {
    let mut image = sunny(0.0);
    image.texels = vec![[0.0; 3]; 128];
    image.texels[0] = [0.0, 0.0, 1.0];
    let scene = under(image);
    assert!(matches!(environment_of(&scene), canted_scene::Environment::Image(_)));
    with_sampler(&scene, |sampler| {
        let from = receiver([0.0; 3], [0.0, 1.0, 0.0]);
        let (mut lit, mut dark) = (0, 0);
        for (choice, [a, b]) in numbers(20_000) {
            let direction = [a - 0.5, b, choice - 0.5];
            let direction = narrow(crate::common::unit(direction.map(f64::from)));
            let density = sampler.density(&from, false, direction, LightId::Environment);
            if lookup(&scene, direction)[2] > 0.0 {
                assert!(density > 0.0, "{direction:?}");
                lit += 1;
            } else if density == 0.0 {
                dark += 1;
            }
        }
        assert!(lit > 100 && dark > 10_000, "{lit} {dark}");
    });
}
