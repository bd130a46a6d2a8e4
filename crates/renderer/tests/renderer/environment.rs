//! Environment maps: orientation, lookups, sampling.

use std::f64::consts::{PI, TAU};

use canted_obb::Affine;
use canted_renderer::{Integrator, LightId, Lights, Settings, environment_of};
use canted_scene::{EnvironmentImage, Light, Material, Scene};
use canted_trace::Ray;

use crate::common::{
    U, Vector, camera, cross, dot, film, mesh, narrow, parallelogram, place, scene, settings, sub, unit,
};
use crate::light::{Estimate, emissive, irradiance, numbers, receiver, with_sampler};

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

/// The sum over texels is the estimate by light sampling; a sun counts by the cosine to it.
#[test]
fn irradiance_from_afar_is_that_of_sampled_light() {
    for normal in [[0.0, 1.0, 0.0], [0.6, 0.0, -0.8], [0.0, -1.0, 0.0]] {
        let mut scene = under(sunny(20.0));
        let Estimate { mean, .. } = irradiance(&scene, &receiver([0.0; 3], normal), N);
        let found = f64::from(Lights::new(&scene).irradiance_from_afar(normal.map(|x| x as f32))[0]);
        // One per cent of noise, and the cosine of a texel's center.
        assert!((found / mean - 1.0).abs() < 0.05, "{normal:?}: {found} {mean}");
        let irradiance = [2.0, 1.0, 0.0];
        scene.lights.push(Light::Sun { direction: normal.map(|x| -x as f32), irradiance });
        let sun = f64::from(Lights::new(&scene).irradiance_from_afar(normal.map(|x| x as f32))[0]) - found;
        assert!((sun - 2.0).abs() < 1e-3, "{normal:?}: {sun}");
    }
}

/// Camera rays see the background, and reflections see the environment.
#[test]
fn the_background_is_seen_by_camera_rays_alone() {
    let mirror = Material { metallic: 1.0, roughness: 0.0, base_color: [1.0; 3], ..Material::default() };
    let square = parallelogram([-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], 0);
    let sky = [0.25, 0.5, 0.125];
    let mut lit = crate::common::under(sky, scene(vec![square], vec![mirror]));
    lit.background = Some([0.5, 0.25, 1.0]);
    // The square fills the middle half of the width and of the height.
    let view = camera([0.0, 0.0, 4.0], [0.0; 3], 2.0 * 0.5_f64.atan().to_degrees() as f32);
    for integrator in Integrator::ALL {
        let settings = Settings { integrator, ..settings(8, 8, 4, 2) };
        let film = film(&lit, &view, &settings);
        assert_eq!(film.pixels()[0].mean(), [0.5, 0.25, 1.0], "{integrator:?}");
        let reflected = film.pixels()[4 * 8 + 4].mean();
        // The hybrid integrator has no mirrors, but the same light.
        assert!((0..3).all(|k| (reflected[k] - f64::from(sky[k])).abs() < 1e-3), "{integrator:?} {reflected:?}");
    }
}

// Irradiance from each kind of light, without occlusion.

const UP: Vector = [0.0, 1.0, 0.0];
const N: u32 = 20_000;

fn lit_by(light: Light) -> Scene {
    Scene { lights: vec![light], ..scene(vec![], vec![]) }
}

/// `π·L·(r/d)²·cosθ` for a sphere above the horizon, from near to extremely distant.
#[test]
fn sphere_matches_closed_form() {
    for (distance, radius) in [(1.25_f32, 1.0_f32), (3.0, 1.0), (100.0, 1.0), (1e5, 1.0), (1e7, 0.5)] {
        let sphere = Light::Sphere { center: [3.0, 4.0 + distance, 5.0], radius, radiance: [2.0; 3] };
        // Skip normals for which part of the sphere is below the horizon.
        for normal in [UP, [0.6, 0.8, 0.0]] {
            let from = receiver([3.0, 4.0, 5.0], normal);
            let [radius, distance] = [radius, (4.0 + distance) - 4.0].map(f64::from);
            if radius / distance > 0.79 && normal != UP {
                continue;
            }
            let expected = PI * 2.0 * (radius / distance).powi(2) * normal[1];
            let estimate = irradiance(&lit_by(sphere), &from, N);
            assert!(estimate.matches(expected), "{distance} {normal:?}: {estimate:?}, {expected}");
        }
    }
}

#[test]
fn sphere_is_black_inside() {
    let sphere = Light::Sphere { center: [0.0; 3], radius: 1.0, radiance: [2.0; 3] };
    for height in [0.0, 0.5, 1.0] {
        assert_eq!(irradiance(&lit_by(sphere), &receiver([0.0, height, 0.0], UP), 100).mean, 0.0);
    }
}

/// `π·L·r²/(r² + h²)` on the axis, zero from behind.
#[test]
fn disk_matches_closed_form() {
    for height in [0.3_f32, 1.0, 50.0] {
        let disk = |normal| lit_by(Light::Disk { center: [1.0, height, 1.0], normal, radius: 2.0, radiance: [3.0; 3] });
        let from = receiver([1.0, 0.0, 1.0], UP);
        let expected = PI * 3.0 * 4.0 / (4.0 + f64::from(height).powi(2));
        let estimate = irradiance(&disk([0.0, -1.0, 0.0]), &from, N);
        assert!(estimate.matches(expected), "{height}: {estimate:?}, {expected}");
        assert_eq!(irradiance(&disk([0.0, 1.0, 0.0]), &from, 100).mean, 0.0);
    }
}

#[test]
fn point_and_sun_match_closed_forms() {
    let from = receiver([1.0, 2.0, 3.0], UP);
    let point = Light::Point { position: [1.0, 5.0, 7.0], intensity: [10.0; 3] };
    assert!(irradiance(&lit_by(point), &from, 10).matches(10.0 / 25.0 * 0.6));
    let sun = Light::Sun { direction: [0.6, -0.8, 0.0], irradiance: [10.0; 3] };
    assert!(irradiance(&lit_by(sun), &from, 10).matches(8.0));
    // A point light at the surface itself is ignored.
    let touching = Light::Point { position: [1.0, 2.0, 3.0], intensity: [10.0; 3] };
    assert_eq!(irradiance(&lit_by(touching), &from, 10).mean, 0.0);
}

/// Constant up to the inner angle, then a squared linear ramp in the cosine, then zero.
#[test]
fn spot_matches_closed_form() {
    let [cos_inner, cos_outer] = [0.9_f32, 0.7];
    let spot = Light::Spot {
        position: [0.0, 2.0, 0.0],
        direction: [0.0, -1.0, 0.0],
        intensity: [10.0; 3],
        cos_inner,
        cos_outer,
    };
    for (cosine, fraction) in [(1.0_f64, 1.0), (0.91, 1.0), (0.8, 0.25), (0.75, 0.0625), (0.69, 0.0)] {
        let from = receiver([2.0 * (1.0 - cosine * cosine).sqrt() / cosine, 0.0, 0.0], UP);
        let expected = 10.0 * fraction * cosine.powi(3) / 4.0;
        let estimate = irradiance(&lit_by(spot), &from, 10);
        // The cone's cosines have one f32 rounding, amplified by the squared slope (1 - 0.8)⁻¹ of the ramp.
        assert!(
            (estimate.mean - expected).abs() <= 100.0 * f64::from(f32::EPSILON),
            "{cosine}: {estimate:?}, {expected}"
        );
    }
}

/// Irradiance from a polygon above the horizon, by Lambert's formula.
pub(super) fn lambert(from: Vector, normal: Vector, radiance: f64, corners: &[Vector]) -> f64 {
    let directions: Vec<Vector> = corners.iter().map(|&corner| unit(sub(corner, from))).collect();
    let edge = |i: usize| {
        let (a, b) = (directions[i], directions[(i + 1) % directions.len()]);
        dot(a, b).clamp(-1.0, 1.0).acos() * dot(unit(cross(a, b)), normal)
    };
    0.5 * radiance * (0..directions.len()).map(edge).sum::<f64>().abs()
}

/// With a mirroring and shearing transform; near, at a grazing angle, and far.
#[test]
fn triangle_matches_lambert_from_both_sides() {
    let triangle = mesh(vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.5], [0.5, 0.0, 1.5]], vec![[0, 1, 2]], 0);
    let map = Affine { columns: [[-1.0, 0.2, 0.0], [0.0, 1.0, 0.0], [0.3, 0.0, 1.0], [0.5, 3.0, -1.0]] };
    let mut lamp = scene(vec![triangle], vec![emissive(4.0)]);
    lamp.instances = vec![place(0, map)];
    let corners = [0, 1, 2].map(|i| map.point(lamp.meshes[0].positions[i]).map(f64::from));
    for (point, normal) in [
        ([0.0, 0.0, 0.0], UP),
        ([0.0, 2.5, 0.0], UP),
        ([6.0, 1.0, 0.0], [-0.8, 0.6, 0.0]),
        ([0.0, 9.0, 0.0], [0.0, -1.0, 0.0]),
        ([300.0, -400.0, 0.0], [-0.6, 0.8, 0.0]),
    ] {
        let expected = lambert(point, normal, 4.0, &corners);
        let estimate = irradiance(&lamp, &receiver(point, normal), N);
        assert!(expected > 0.0 && estimate.matches(expected), "{point:?}: {estimate:?}, {expected}");
    }
}

/// Up close, solid angle sampling has far less variance than area sampling.
#[test]
fn near_triangles_are_sampled_by_solid_angle() {
    let corners = [[-1.0, 0.3, -1.0], [1.5, 0.3, -0.5], [0.0, 0.3, 2.0]];
    let lamp = scene(vec![mesh(corners.to_vec(), vec![[0, 1, 2]], 0)], vec![emissive(4.0)]);
    let by_angle = irradiance(&lamp, &receiver([0.0; 3], UP), N);
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let across = cross(sub(b, a), sub(c, a));
    let area = 0.5 * dot(across, across).sqrt();
    let by_area = Estimate::of(numbers(N).map(|(_, [u, v])| {
        let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] }.map(f64::from);
        let offset: Vector = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        4.0 * area * (offset[1] / dot(offset, offset)).powi(2)
    }));
    assert!((by_area.mean - by_angle.mean).abs() < 5.0 * by_area.error, "{by_area:?} {by_angle:?}");
    let gain = (by_area.error / by_angle.error).powi(2);
    assert!(gain > 20.0, "{gain}");
}

/// A transparent, black, moving or degenerate triangle is not sampled.
#[test]
fn invisible_and_moving_triangles_are_not_sampled() {
    let triangle = mesh(vec![[0.0, 1.0, 0.0], [2.0, 1.0, 0.5], [0.5, 1.0, 1.5]], vec![[0, 1, 2]], 0);
    let from = receiver([0.5, 0.0, 0.5], UP);
    let lamp = scene(vec![triangle], vec![emissive(4.0)]);
    assert!(irradiance(&lamp, &from, 100).mean > 0.0);
    let mut moving = lamp.clone();
    moving.instances[0].world_from_object_close =
        Some(Affine { columns: [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] });
    let mut black = lamp.clone();
    black.materials[0].emission = [0.0; 3];
    let mut flat = lamp.clone();
    flat.meshes[0].positions[2] = flat.meshes[0].positions[1];
    let mut cut = lamp;
    cut.materials[0].alpha_mode = canted_scene::AlphaMode::Mask { cutoff: 0.5 };
    cut.materials[0].alpha = 0.25;
    for scene in [moving, black, flat, cut] {
        assert_eq!(irradiance(&scene, &from, 100).mean, 0.0);
    }
}

/// The test above detects a PDF that is 5 % too large.
#[test]
fn test_detects_wrong_pdf() {
    let sphere = Light::Sphere { center: [0.0, 3.0, 0.0], radius: 1.0, radiance: [2.0; 3] };
    let wrong = Light::Sphere { center: [0.0, 3.0, 0.0], radius: 0.975, radiance: [2.0; 3] };
    let from = receiver([0.0; 3], UP);
    assert!(!irradiance(&lit_by(wrong), &from, N).matches(PI * 2.0 / 9.0));
    assert!(irradiance(&lit_by(sphere), &from, N).matches(PI * 2.0 / 9.0));
    with_sampler(&lit_by(sphere), |sampler| {
        let [sample, other] = [0.1, 0.9].map(|x| sampler.sample(&from, false, 0.5, [x, 0.5]).unwrap());
        assert!(sample.to_light != other.to_light && sample.density == other.density && !sample.is_delta);
    });
}
