//! Irradiance from each kind of light, without occlusion.

use std::f64::consts::PI;

use canted_obb::Affine;
use canted_scene::{Light, Scene};

use super::{Estimate, emissive, irradiance, numbers, receiver, with_sampler};
use crate::common::{Vector, cross, dot, mesh, place, scene, sub, unit};

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
