//! Environments: which direction is where in the picture, and how much light there is.

use std::f64::consts::{PI, TAU};

use canted_renderer::{LightId, Lights, environment_of};
use canted_scene::{EnvironmentImage, Scene};
use canted_trace::Ray;

use super::{irradiance, numbers, receiver, with_sampler};
use crate::common::{U, Vector, dot, narrow, scene};

/// A dim picture with a bright texel, as a sky with a sun has.
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

/// Red radiance, written anew: bilinear between the centres of texels.
fn radiance(image: &EnvironmentImage, [x, y, z]: Vector) -> f64 {
    let turn = f64::from(image.turn_degrees) / 360.0;
    let u = ((x.atan2(-z) / TAU + 0.5 + turn).rem_euclid(1.0)) * f64::from(image.width) - 0.5;
    let v = (y.clamp(-1.0, 1.0).acos() / PI) * f64::from(image.height) - 0.5;
    let mut sum = 0.0;
    for (i, a) in [(u.floor(), 1.0 - (u - u.floor())), (u.floor() + 1.0, u - u.floor())] {
        for (j, b) in [(v.floor(), 1.0 - (v - v.floor())), (v.floor() + 1.0, v - v.floor())] {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in the picture")]
            let (i, j) =
                (i.rem_euclid(f64::from(image.width)) as usize, j.clamp(0.0, f64::from(image.height) - 1.0) as usize);
            sum += a * b * f64::from(image.texels[j * image.width as usize + i][0]);
        }
    }
    sum * f64::from(image.scale[0])
}

fn seen(scene: &Scene, direction: [f32; 3]) -> [f32; 3] {
    let met = Lights::new(scene).intersect(&Ray::new([5.0, -3.0, 2.0], direction), None).unwrap();
    assert_eq!(met.light, LightId::Environment);
    met.radiance
}

/// The middle of the picture is -z, right of it +x, the top +y; turned, it follows counter-clockwise from above.
#[test]
fn directions_are_where_the_convention_says() {
    let marked = |column: usize, row: usize, turn_degrees| {
        let mut image = EnvironmentImage { turn_degrees, ..sunny(0.0) };
        image.texels = vec![[0.0; 3]; 128];
        // Four texels around a corner share it evenly.
        for (i, j) in [(column + 15, row - 1), (column, row - 1), (column + 15, row), (column, row)] {
            image.texels[j * 16 + i % 16] = [0.5, 1.0, 2.0];
        }
        under(image)
    };
    for (column, direction) in
        [(8, [0.0, 0.0, -3.0]), (12, [2.0, 0.0, 0.0]), (0, [0.0, 0.0, 0.1]), (4, [-1.0, 0.0, 0.0])]
    {
        assert_eq!(seen(&marked(column, 4, 0.0), direction), [1.0; 3], "column {column}");
        assert_eq!(seen(&marked(column, 4, 0.0), direction.map(|x| -x)), [0.0; 3], "column {column}");
    }
    // A quarter turn takes -z to -x.
    assert_eq!(seen(&marked(8, 4, 90.0), [-1.0, 0.0, 0.0]), [1.0; 3]);
    assert_eq!(seen(&marked(8, 4, -90.0), [1.0, 0.0, 0.0]), [1.0; 3]);
    let poles = under(EnvironmentImage {
        texels: (0..128).map(|i| if i < 16 { [1.0; 3] } else { [0.0; 3] }).collect(),
        scale: [1.0; 3],
        ..sunny(0.0)
    });
    assert_eq!((seen(&poles, [0.0, 1.0, 0.0]), seen(&poles, [0.0, -1.0, 0.0])), ([1.0; 3], [0.0; 3]));
    assert_eq!(seen(&poles, [1e-20, 1e-3, 0.0]), [1.0; 3]);
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
            // The slope is 160 a texel, and a few texels wide is what a rounding of the angle or the weight is not.
            assert!((f64::from(seen(&scene, direction)[0]) - expected).abs() < 1e-4, "{direction:?}");
        }
    }
}

/// Radiance, the share of the sky and the sample round once each; the cosine of a rounded direction errs by a rounding over itself,
/// of which the mean over directions by the cosine is two.
const CONSTANT_ERROR: f64 = 5.0 * U;

/// On an open plane every sample of a constant environment is π times its radiance.
#[test]
fn a_constant_environment_is_sampled_without_noise() {
    let sky = Scene { environment: Some([3.0, 2.0, 1.0].into()), ..scene(vec![], vec![]) };
    let normal = [0.6, 0.0, 0.8];
    let estimate = irradiance(&sky, &receiver([1.0; 3], normal), 1000);
    let bound = 3.0 * PI * CONSTANT_ERROR;
    assert!((estimate.mean - 3.0 * PI).abs() <= bound && estimate.error <= bound, "{estimate:?}");
}

/// Midpoint rule over the hemisphere about a normal.
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
fn an_image_gives_the_irradiance_of_quadrature() {
    for (turn, normal) in [(0.0, [0.0, 1.0, 0.0]), (77.0, [0.6, 0.0, 0.8]), (200.0, [0.0, -0.6, 0.8])] {
        let image = sunny(turn);
        let expected = quadrature(&image, normal);
        let estimate = irradiance(&under(image), &receiver([0.0; 3], normal), 100_000);
        // The quadrature's own error: kinks of the bilinear picture and of the horizon, second order in the step.
        assert!(
            (estimate.mean - expected).abs() < 5.0 * estimate.error + 1e-4 * expected,
            "{turn}: {estimate:?} {expected}"
        );
    }
}

/// The mean over all directions is what quadrature over two opposite hemispheres of no cosine gives.
#[test]
fn the_ambient_is_the_mean() {
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
    // The mean weighs a texel's slope along the latitude as if its solid angle were even: second order in the texel.
    assert!((ambient / expected - 1.0).abs() < 0.02, "{ambient} {expected}");
}

/// Most samples look at the sun, though it is a hundredth of the sky; a black picture has none.
#[test]
fn the_sun_in_the_picture_is_found() {
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

/// Where one texel alone is bright, all directions that the bilinear picture lights have a density.
#[test]
fn every_lit_direction_has_a_density() {
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
            if seen(&scene, direction)[2] > 0.0 {
                assert!(density > 0.0, "{direction:?}");
                lit += 1;
            } else if density == 0.0 {
                dark += 1;
            }
        }
        assert!(lit > 100 && dark > 10_000, "{lit} {dark}");
    });
}
