//! The ambient term against closed forms and quadrature.

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
fn an_open_plane_has_all_of_the_sky() {
    let plane = in_white_sky(scene(vec![floor(10.0, 0.0, 0)], vec![grey(1.0)]));
    for radius in [0.1, 1.0, f32::INFINITY] {
        assert_eq!(ambient(&plane, [1.0, 2.0, 3.0], [0.0; 3], radius, 64), 1.0);
    }
}

/// A wall beside the point hides half of the cosine-weighted sky.
#[test]
fn beside_a_very_large_wall_half_is_left() {
    let wall = parallelogram([0.0, 0.0, -1e6], [0.0, 1e6, 0.0], [0.0, 0.0, 2e6], 0);
    let corner = in_white_sky(scene(vec![floor(10.0, 0.0, 0), wall], vec![grey(1.0)]));
    let value = ambient(&corner, [2.0, 2.0, 0.0], [1e-3, 0.0, 0.0], f32::INFINITY, 4096);
    assert!((value - 0.5).abs() < 0.005, "{value}");
}

#[test]
fn a_closed_box_has_no_sky() {
    let closed = in_white_sky(scene(vec![cuboid([-1.0; 3], [1.0; 3], 0)], vec![grey(1.0)]));
    assert_eq!(ambient(&closed, [0.5, 0.5, 0.5], [0.0, -1.0, 0.0], f32::INFINITY, 64), 0.0);
}

/// Four standard errors of `n` samples of a value in 0..=1 with the bound 1/2 on its standard deviation; stratified
/// samples do better.
fn noise(n: u32) -> f64 {
    4.0 * 0.5 / f64::from(n).sqrt()
}

/// In a sphere of radius R the chord at polar cosine c is 2Rc long, so with k = 2R/r the cosine-weighted mean of
/// `1 - exp(-kc)` is `1 - 2(1 - (1 + k)·exp(-k))/k²`.
#[test]
fn a_closed_sphere_follows_the_closed_form_in_the_radius() {
    let ball = in_white_sky(scene(vec![inside_out(sphere([0.0; 3], 1.0, 4, 0))], vec![grey(1.0)]));
    for radius in [0.25_f32, 1.0, 4.0] {
        let k = 2.0 / f64::from(radius);
        let expected = 1.0 - 2.0 * (1.0 - (1.0 + k) * (-k).exp()) / (k * k);
        let value = ambient(&ball, [0.1, 0.2, 0.3], [0.2, -0.9, 0.1], radius, 4096);
        // 2048 triangles stay within 0.3 % of the sphere's radius, and so do the chords.
        assert!((value - expected).abs() < noise(4096) + 0.003 * k, "radius {radius}: {value} for {expected}");
    }
}

/// In the middle of the floor of a closed box, against quadrature over the hemisphere with exact distances.
#[test]
fn a_closed_box_follows_quadrature() {
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
fn a_corner_is_darker_than_the_open() {
    let wall = parallelogram([0.0, 0.0, -10.0], [0.0, 10.0, 0.0], [0.0, 0.0, 20.0], 0);
    let corner = in_white_sky(scene(vec![floor(10.0, 0.0, 0), wall], vec![grey(1.0)]));
    let at = |x: f32| ambient(&corner, [x + 1.0, 2.0, 0.0], [x, 0.0, 0.0], 1.0, 256);
    let values = [at(0.01), at(0.3), at(1.0), at(5.0)];
    assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "{values:?}");
}

/// The sky is counted once: on an open plane a picture of any depth shows albedo times sky, and no more.
#[test]
fn the_sky_is_counted_once() {
    let plane = in_white_sky(scene(vec![floor(10.0, 0.0, 0)], vec![grey(0.5)]));
    for bounces in 0..4 {
        assert_eq!(
            probe(&plane, [1.0, 2.0, 3.0], [0.0; 3], Settings { ao_radius: Some(1.0), ..settings(1, 1, 16, bounces) }),
            [0.5; 3]
        );
    }
}
