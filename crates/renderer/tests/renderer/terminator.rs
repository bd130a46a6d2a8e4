//! The edge of the light on coarse meshes with smooth normals.

use canted_renderer::{Integrator, Levels, Settings};
use canted_scene::{Light, Mesh};

use crate::common::{camera, film_of, gray, prepared, scene, settings, sphere, under};

/// A ball of `8·4^level` triangles with the normals of a sphere.
fn ball(level: u32) -> Mesh {
    let mesh = sphere([0.0; 3], 1.0, level, 0);
    Mesh { normals: Some(mesh.positions.clone()), ..mesh }
}

/// Radiance at points of a ball in the light of a sun from the side, by the distance of the point from the center of the picture.
fn lit(level: u32, integrator: Integrator, direction: [f32; 3]) -> Vec<f64> {
    let mut stage = under([0.0; 3], scene(vec![ball(level)], vec![gray(1.0)]));
    stage.lights = vec![Light::Sun { direction, irradiance: [std::f32::consts::PI; 3] }];
    let bvh = prepared(&stage, Levels::Auto);
    let settings = Settings { integrator, ..settings(64, 64, 16, 0) };
    let film = film_of(&stage, &bvh, &camera([0.0, 0.0, 10.0], [0.0; 3], 11.6), &settings);
    let is_inner = |i: usize| {
        let [x, y] = [i % 64, i / 64].map(|k| (k as f64 - 31.5) / 31.5);
        x * x + y * y < 0.75
    };
    film.pixels().iter().enumerate().filter(|(i, _)| is_inner(*i)).map(|(_, pixel)| pixel.mean()[0]).collect()
}

/// A ball of 128 triangles is lit like one of 32,768: within 0.1 everywhere, which the normals explain, and within 0.01 in the mean. With the
/// horizons of its triangles it differs by 0.2, where whole triangles are dark.
#[test]
fn a_coarse_ball_has_the_edge_of_a_fine_one() {
    for integrator in Integrator::ALL {
        for direction in [[-1.0, 0.0, 0.0], [0.6, -0.64, -0.48], [0.8, 0.0, 0.6]] {
            let [coarse, fine] = [2, 6].map(|level| lit(level, integrator, direction));
            let apart: Vec<f64> = coarse.iter().zip(&fine).map(|(a, b)| (a - b).abs()).collect();
            let most = apart.iter().fold(0.0, |a: f64, &b| a.max(b));
            let mean = apart.iter().sum::<f64>() / apart.len() as f64;
            assert!(most < 0.1 && mean < 0.01, "{integrator:?} {direction:?}: {most} {mean}");
        }
    }
}
