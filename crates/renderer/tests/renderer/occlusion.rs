//! The ambient term compared with closed forms and quadrature.

use std::f64::consts::TAU;

use canted_renderer::Settings;
use canted_scene::Scene;

use crate::common::{Vector, cuboid, dot, floor, grey, inside_out, parallelogram, probe, scene, settings, sphere};

fn in_white_sky(mut scene: Scene) -> Scene {
    scene.environment = Some([1.0; 3].into());
    scene
}

fn ambient(scene: &Scene, eye: [f32; 3], target: [f32; 3], radius: f32, samples: u32) -> f64 {
    probe(scene, eye, target, Settings { ao_radius: Some(radius), ..settings(1, 1, samples, 0) })[0]
}

#[test]
fn open_plane_is_unoccluded() {
    let plane = in_white_sky(scene(vec![floor(10.0, 0.0, 0)], vec![grey(1.0)]));
    for radius in [0.1, 1.0, f32::INFINITY] {
        assert_eq!(ambient(&plane, [1.0, 2.0, 3.0], [0.0; 3], radius, 64), 1.0);
    }
}

/// A wall next to the point hides half of the cosine-weighted sky.
#[test]
fn very_large_wall_occludes_half() {
    let wall = parallelogram([0.0, 0.0, -1e6], [0.0, 1e6, 0.0], [0.0, 0.0, 2e6], 0);
    let corner = in_white_sky(scene(vec![floor(10.0, 0.0, 0), wall], vec![grey(1.0)]));
    let value = ambient(&corner, [2.0, 2.0, 0.0], [1e-3, 0.0, 0.0], f32::INFINITY, 4096);
    assert!((value - 0.5).abs() < 0.005, "{value}");
}

#[test]
fn closed_box_is_fully_occluded() {
    let closed = in_white_sky(scene(vec![cuboid([-1.0; 3], [1.0; 3], 0)], vec![grey(1.0)]));
    assert_eq!(ambient(&closed, [0.5, 0.5, 0.5], [0.0, -1.0, 0.0], f32::INFINITY, 64), 0.0);
}

/// Four standard errors of `n` samples in 0..=1, whose standard deviation is at most 1/2; stratified samples are
/// better.
fn noise(n: u32) -> f64 {
    4.0 * 0.5 / f64::from(n).sqrt()
}

/// In a sphere of radius R the chord at polar cosine c is 2Rc long, so with k = 2R/r the cosine-weighted mean of
/// `1 - exp(-kc)` is `1 - 2(1 - (1 + k)·exp(-k))/k²`.
#[test]
fn closed_sphere_matches_closed_form() {
    let ball = in_white_sky(scene(vec![inside_out(sphere([0.0; 3], 1.0, 4, 0))], vec![grey(1.0)]));
    for radius in [0.25_f32, 1.0, 4.0] {
        let k = 2.0 / f64::from(radius);
        let expected = 1.0 - 2.0 * (1.0 - (1.0 + k) * (-k).exp()) / (k * k);
        let value = ambient(&ball, [0.1, 0.2, 0.3], [0.2, -0.9, 0.1], radius, 4096);
        // 2048 triangles are within 0.3 % of the sphere's radius, and so are the chords.
        assert!((value - expected).abs() < noise(4096) + 0.003 * k, "radius {radius}: {value} for {expected}");
    }
}

/// At the center of the floor of a closed box, compared with quadrature over the hemisphere with exact distances.
#[test]
fn closed_box_matches_quadrature() {
    let (min, max): (Vector, Vector) = ([-1.0, 0.0, -2.0], [1.5, 1.0, 2.0]);
    let closed = in_white_sky(scene(vec![cuboid([-1.0, 0.0, -2.0], [1.5, 1.0, 2.0], 0)], vec![grey(1.0)]));
    let distance = |d: Vector| {
        let to_side =
            |k: usize| if d[k] == 0.0 { f64::INFINITY } else { (if d[k] > 0.0 { max[k] } else { min[k] }) / d[k] };
        to_side(0).min(to_side(1)).min(to_side(2))
    };
    const RINGS: u32 = 400;
    const SECTORS: u32 = 800;
    for radius in [0.3_f32, 2.0] {
        let mut sum = 0.0;
        for i in 0..RINGS {
            // Rings of equal cosine-weighted measure.
            let sine = ((f64::from(i) + 0.5) / f64::from(RINGS)).sqrt();
            for j in 0..SECTORS {
                let (s, c) = (TAU * (f64::from(j) + 0.5) / f64::from(SECTORS)).sin_cos();
                let d = [sine * c, (1.0 - sine * sine).sqrt(), sine * s];
                assert!((dot(d, d) - 1.0).abs() < 1e-12);
                sum += 1.0 - (-distance(d) / f64::from(radius)).exp();
            }
        }
        let expected = sum / f64::from(RINGS * SECTORS);
        let value = ambient(&closed, [0.5, 0.5, 0.5], [0.0; 3], radius, 4096);
        assert!((value - expected).abs() < noise(4096), "radius {radius}: {value} for {expected}");
    }
}

#[test]
fn corner_is_darker_than_open_floor() {
    let wall = parallelogram([0.0, 0.0, -10.0], [0.0, 10.0, 0.0], [0.0, 0.0, 20.0], 0);
    let corner = in_white_sky(scene(vec![floor(10.0, 0.0, 0), wall], vec![grey(1.0)]));
    let at = |x: f32| ambient(&corner, [x + 1.0, 2.0, 0.0], [x, 0.0, 0.0], 1.0, 256);
    let values = [at(0.01), at(0.3), at(1.0), at(5.0)];
    assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "{values:?}");
}

/// The environment counts once: on an open plane an image of any depth shows albedo times environment.
#[test]
fn environment_counts_once() {
    let plane = in_white_sky(scene(vec![floor(10.0, 0.0, 0)], vec![grey(0.5)]));
    for bounces in 0..4 {
        assert_eq!(
            probe(&plane, [1.0, 2.0, 3.0], [0.0; 3], Settings { ao_radius: Some(1.0), ..settings(1, 1, 16, bounces) }),
            [0.5; 3]
        );
    }
}
