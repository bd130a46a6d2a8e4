//! Light sampling with many lights.

use std::f64::consts::PI;

use canted_renderer::{LightId, Pattern, Sampler, Surface};
use canted_scene::{Light, Material, Scene};

use super::irradiance::lambert;
use super::{Estimate, emissive, irradiance, numbers, receiver, with_sampler};
use crate::common::{Vector, dot, mesh, scene, sub};

/// Small random triangles in a hall 40 wide, 20 long and 4 high, with radiances between 1 and 10.
fn hall(n: u32) -> Scene {
    let sampler = Sampler::new(Pattern::Random, 1, 3);
    let (mut meshes, mut materials) = (Vec::new(), Vec::new());
    for i in 0..n {
        let number = |k: u32| sampler.single(i, 0, k);
        let center = [40.0 * number(0), 0.5 + 4.0 * number(1), 20.0 * number(2)];
        let corner =
            |j: u32| std::array::from_fn(|k| center[k] + 0.1 * (number(3 + 3 * j + u32::try_from(k).unwrap()) - 0.5));
        meshes.push(mesh(vec![corner(0), corner(1), corner(2)], vec![[0, 1, 2]], i));
        materials.push(Material { ..emissive(1.0 + 9.0 * number(12)) });
    }
    scene(meshes, materials)
}

fn corners(scene: &Scene, i: usize) -> [Vector; 3] {
    [0, 1, 2].map(|k| scene.meshes[i].positions[k].map(f64::from))
}

const UP: Vector = [0.0, 1.0, 0.0];

#[test]
fn samples_of_many_lights_are_unbiased() {
    let hall = hall(500);
    for point in [[20.0, 0.0, 10.0], [3.0, 0.1, 1.0], [-30.0, 0.2, 5.0]] {
        let each = |i: usize| lambert(point, UP, hall.materials[i].emission[0].into(), &corners(&hall, i));
        let expected: f64 = (0..500).map(each).sum();
        let estimate = irradiance(&hall, &receiver(point, UP), 50_000);
        assert!(estimate.matches(expected), "{point:?}: {estimate:?} {expected}");
        assert!(estimate.error < 0.02 * expected, "{estimate:?}");
    }
}

/// All kinds of lights together: some behind the receiver, a spot that points away, a black light and a NaN light.
#[test]
fn samples_of_all_kinds_of_lights_are_unbiased() {
    let mut scene = hall(20);
    scene.environment = Some([0.25; 3].into());
    scene.lights = vec![
        Light::Point { position: [3.0, 2.0, 4.0], intensity: [7.0; 3] },
        Light::Point { position: [3.0, -2.0, 4.0], intensity: [700.0; 3] },
        Light::Point { position: [3.0, 2.0, 8.0], intensity: [0.0; 3] },
        Light::Point { position: [3.0, 2.0, 9.0], intensity: [f32::NAN; 3] },
        Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [0.5; 3] },
        Light::Sun { direction: [0.6, -0.8, 0.0], irradiance: [0.001; 3] },
        Light::Sphere { center: [15.0, 6.0, 10.0], radius: 1.0, radiance: [2.0; 3] },
        Light::Spot {
            position: [5.0, 3.0, 5.0],
            direction: [0.0, 1.0, 0.0],
            intensity: [9.0; 3],
            cos_inner: 0.9,
            cos_outer: 0.8,
        },
    ];
    let point = [10.0, 0.0, 10.0];
    let triangles: f64 =
        (0..20).map(|i| lambert(point, UP, scene.materials[i].emission[0].into(), &corners(&scene, i))).sum();
    let offset = sub([3.0, 2.0, 4.0], point);
    let bulb = 7.0 * offset[1] / dot(offset, offset).powf(1.5);
    let offset = sub([15.0, 6.0, 10.0], point);
    let sphere = PI * 2.0 * offset[1] / dot(offset, offset).powf(1.5);
    let expected = triangles + 0.25 * PI + bulb + 0.5 + 0.8 * 0.001 + sphere;
    let estimate = irradiance(&scene, &receiver(point, UP), 200_000);
    assert!(estimate.matches(expected), "{estimate:?} {expected}");
}

/// Thousands of emitters: the light tree compared with selection by power.
///
/// The remaining variance is due to the horizon and to shapes within the clusters.
#[test]
fn light_tree_has_less_variance_than_power_sampling() {
    const N: usize = 3000;
    let hall = hall(3000);
    let of = |i: usize| {
        let [a, b, c] = corners(&hall, i);
        let across = crate::common::cross(sub(b, a), sub(c, a));
        let area = 0.5 * dot(across, across).sqrt();
        (area * f64::from(hall.materials[i].emission[0]), [a, b, c], across)
    };
    let mut sums = vec![0.0];
    for i in 0..N {
        sums.push(sums[i] + of(i).0);
    }
    for point in [[20.0, 0.0, 10.0], [1.0, 0.0, 1.0]] {
        let by_power = Estimate::of(numbers(20_000).map(|(choice, [u, v])| {
            let i = sums.partition_point(|&sum| sum <= f64::from(choice) * sums[N]) - 1;
            let (power, [a, b, c], across) = of(i);
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] }.map(f64::from);
            let offset: Vector = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]) - point[k]);
            let cosines = offset[1] * dot(offset, across).abs() / dot(across, across).sqrt();
            // Radiance · area · cosines / distance² over the probability of the emitter.
            power * cosines / dot(offset, offset).powi(2) / (power / sums[N])
        }));
        let by_tree = irradiance(&hall, &receiver(point, UP), 20_000);
        assert!(
            (by_tree.mean - by_power.mean).abs() < 5.0 * by_tree.error.hypot(by_power.error),
            "{by_tree:?} {by_power:?}"
        );
        let gain = (by_power.error / by_tree.error).powi(2);
        assert!(gain > 10.0, "{gain}");
    }
}

/// The geometric normal decides which lights count, not the shading normal: lights behind the triangle are never
/// chosen, and lights in front of it are chosen even if they are behind the shading normal.
#[test]
fn geometric_normal_decides_which_lights_count() {
    let mut scene = hall(0);
    let bulb = |height: f32| Light::Point { position: [10.0, height, 10.0], intensity: [7.0; 3] };
    scene.lights = [bulb(2.0)].into_iter().chain((1..=9_u8).map(|k| bulb(-f32::from(k)))).collect();
    let perturbed = Surface { shading_normal: [0.8, -0.6, 0.0], ..receiver([10.0, 0.0, 10.0], UP) };
    with_sampler(&scene, |sampler| {
        let chosen = |transmits: bool, light: u32| {
            let samples =
                numbers(500).filter_map(|(choice, square)| sampler.sample(&perturbed, transmits, choice, square));
            samples.filter(|sample| sample.light == LightId::Light(light)).count()
        };
        assert_eq!(chosen(false, 0), 500);
        assert!(chosen(true, 0) > 0 && chosen(true, 1) > 0);
    });
}

/// Sampling is deterministic.
#[test]
fn sampling_is_deterministic() {
    let from = receiver([20.0, 0.0, 10.0], UP);
    let samples = || {
        with_sampler(&hall(300), |sampler| {
            numbers(500).map(|(choice, square)| sampler.sample(&from, false, choice, square)).collect::<Vec<_>>()
        })
    };
    let first = samples();
    assert!(first == samples() && first.iter().flatten().count() > 400);
}

#[test]
fn scene_without_lights_has_no_samples() {
    let from = receiver([0.0; 3], UP);
    with_sampler(&scene(vec![], vec![]), |sampler| {
        assert!(numbers(10).all(|(choice, square)| sampler.sample(&from, false, choice, square).is_none()));
    });
}
