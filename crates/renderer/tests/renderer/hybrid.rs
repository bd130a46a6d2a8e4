//! The ambient term compared with closed forms and quadrature.

use std::f64::consts::{PI, SQRT_2, TAU};

use canted_film::Filter;
use canted_obb::Affine;
use canted_renderer::{Hemisphere, Integrator, Pattern, Settings};
use canted_scene::{Camera, Light, Material, Mesh, Projection, Scene};

use crate::common::{
    Vector, camera, cross, cuboid, dot, film, floor, gray, inside_out, parallelogram, place, probe, scene, settings,
    sphere, sub, under, unit,
};

fn in_white_sky(mut scene: Scene) -> Scene {
    scene.environment = Some([1.0; 3].into());
    scene
}

fn ambient(scene: &Scene, eye: [f32; 3], target: [f32; 3], radius: f32, samples: u32) -> f64 {
    probe(scene, eye, target, Settings { ao_radius: Some(radius), ..settings(1, 1, samples, 0) })[0]
}

#[test]
fn open_plane_is_unoccluded() {
    let plane = in_white_sky(scene(vec![floor(10.0, 0.0, 0)], vec![gray(1.0)]));
    for radius in [0.1, 1.0, f32::INFINITY] {
        assert_eq!(ambient(&plane, [1.0, 2.0, 3.0], [0.0; 3], radius, 64), 1.0);
    }
}

/// A wall next to the point hides half of the cosine-weighted sky.
#[test]
fn very_large_wall_occludes_half() {
    let wall = parallelogram([0.0, 0.0, -1e6], [0.0, 1e6, 0.0], [0.0, 0.0, 2e6], 0);
    let corner = in_white_sky(scene(vec![floor(10.0, 0.0, 0), wall], vec![gray(1.0)]));
    let value = ambient(&corner, [2.0, 2.0, 0.0], [1e-3, 0.0, 0.0], f32::INFINITY, 4096);
    assert!((value - 0.5).abs() < 0.005, "{value}");
}

/// The same by uniform directions, of both integrators.
#[test]
fn uniform_directions_give_the_same_mean() {
    let wall = parallelogram([0.0, 0.0, -1e6], [0.0, 1e6, 0.0], [0.0, 0.0, 2e6], 0);
    let corner = in_white_sky(scene(vec![floor(10.0, 0.0, 0), wall], vec![gray(1.0)]));
    let value = |integrator, hemisphere, samples| {
        let settings = Settings { integrator, hemisphere, pattern: Pattern::Random, ..settings(1, 1, samples, 0) };
        let ao_radius = Some(f32::INFINITY);
        probe(&corner, [2.0, 2.0, 0.0], [1e-3, 0.0, 0.0], Settings { ao_radius, ..settings })[0]
    };
    for integrator in Integrator::ALL {
        let [cosine, uniform] = Hemisphere::ALL.map(|hemisphere| value(integrator, hemisphere, 8192));
        // Weights are at most 2, so four standard errors are at most 0.044.
        assert!((cosine - 0.5).abs() < 0.044 && (uniform - 0.5).abs() < 0.044, "{integrator:?}: {cosine} {uniform}");
        assert!(cosine != uniform, "{integrator:?}");
    }
}

#[test]
fn closed_box_is_fully_occluded() {
    let closed = in_white_sky(scene(vec![cuboid([-1.0; 3], [1.0; 3], 0)], vec![gray(1.0)]));
    assert_eq!(ambient(&closed, [0.5, 0.5, 0.5], [0.0, -1.0, 0.0], f32::INFINITY, 64), 0.0);
}

/// In a closed emitter with emission 1 and albedo 1/2, `n` surfaces scatter light of `1/2^n`. Of what more than one scattered, each sample
/// brings at most the limit.
#[test]
fn a_limit_counts_for_light_that_several_surfaces_scattered() {
    let emissive = Material { emission: [1.0; 3], ..gray(0.5) };
    let closed = scene(vec![inside_out(cuboid([-1.0; 3], [1.0; 3], 0))], vec![emissive]);
    for (clamp, want) in
        [(None, 1.9375), (Some(1.0), 1.9375), (Some(0.1), 1.5 + 0.1 + 0.1 + 0.0625), (Some(0.05), 1.5 + 3.0 * 0.05)]
    {
        let settings = Settings { clamp, ..settings(1, 1, 16, 4) };
        let got = probe(&closed, [0.0; 3], [0.1, 0.2, 1.0], settings)[0];
        assert!((got - want).abs() < 1e-5, "{clamp:?}: {got} for {want}");
    }
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
    let ball = in_white_sky(scene(vec![inside_out(sphere([0.0; 3], 1.0, 4, 0))], vec![gray(1.0)]));
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
    let closed = in_white_sky(scene(vec![cuboid([-1.0, 0.0, -2.0], [1.5, 1.0, 2.0], 0)], vec![gray(1.0)]));
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
    let corner = in_white_sky(scene(vec![floor(10.0, 0.0, 0), wall], vec![gray(1.0)]));
    let at = |x: f32| ambient(&corner, [x + 1.0, 2.0, 0.0], [x, 0.0, 0.0], 1.0, 256);
    let values = [at(0.01), at(0.3), at(1.0), at(5.0)];
    assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "{values:?}");
}

/// The environment counts once: on an open plane an image of any depth shows albedo times environment.
#[test]
fn environment_counts_once() {
    let plane = in_white_sky(scene(vec![floor(10.0, 0.0, 0)], vec![gray(0.5)]));
    for bounces in 0..4 {
        assert_eq!(
            probe(&plane, [1.0, 2.0, 3.0], [0.0; 3], Settings { ao_radius: Some(1.0), ..settings(1, 1, 16, bounces) }),
            [0.5; 3]
        );
    }
}

// Direct lighting, shadows, bounces, and convergence.

/// Relative error of a radiance in `f32`: a dozen roundings, and a pixel a hundredth of a degree wide.
const PROBE_ERROR: f64 = 1e-3;

fn is_close(value: f64, expected: f64) -> bool {
    (value - expected).abs() <= PROBE_ERROR * expected
}

#[test]
fn point_light_follows_inverse_square_and_cosine() {
    let mut plane = scene(vec![floor(100.0, 0.0, 0)], vec![gray(0.5)]);
    let height = 3.0;
    plane.lights = vec![Light::Point { position: [0.0, 3.0, 0.0], intensity: [10.0, 20.0, 40.0] }];
    for x in [0.0_f32, 1.0, 4.0, 30.0] {
        let radiance = probe(&plane, [x, 5.0, 5.0], [x, 0.0, 0.0], settings(1, 1, 4, 0));
        let square = f64::from(x).powi(2) + height * height;
        let irradiance = 10.0 * height / square.powf(1.5);
        for (k, factor) in [1.0, 2.0, 4.0].into_iter().enumerate() {
            assert!(is_close(radiance[k], factor * irradiance * 0.5 / PI), "x {x}: {radiance:?}");
        }
    }
}

#[test]
fn sun_gives_irradiance_times_cosine() {
    let mut plane = scene(vec![floor(100.0, 0.0, 0)], vec![gray(0.5)]);
    for (direction, cosine) in [([0.0, -1.0, 0.0], 1.0), ([0.6, -0.8, 0.0], 0.8), ([0.0, 0.8, 0.6], 0.0)] {
        plane.lights = vec![Light::Sun { direction, irradiance: [std::f32::consts::PI; 3] }];
        let radiance = probe(&plane, [0.0, 5.0, 5.0], [0.0; 3], settings(1, 1, 4, 0));
        assert!(is_close(radiance[0], 0.5 * cosine), "{direction:?}: {radiance:?}");
    }
}

/// Minimum distance from the center of a unit sphere to the planes of its triangles: 1 minus this bounds the depth of
/// points on them, and its arc cosine bounds the tilt of their normals.
fn least_plane(sphere_mesh: &Mesh) -> f64 {
    let planes = sphere_mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|i| sphere_mesh.positions[i as usize].map(f64::from));
        dot(unit(cross(sub(b, a), sub(c, a))), a)
    });
    planes.fold(1.0, f64::min)
}

/// Each pixel of a sphere under one sun is `ρ/π·E·cosθ` at its center: bright side, dark side and terminator.
#[test]
fn sphere_under_a_sun_is_lambertian_in_every_pixel() {
    const N: u32 = 24;
    const HEIGHT: f64 = 2.2;
    let albedo = [0.25_f32, 0.5, 0.75];
    let irradiance = [3.0_f32, 2.0, 1.0];
    let mut sphere_mesh = sphere([0.0; 3], 1.0, 4, 0);
    sphere_mesh.normals = Some(sphere_mesh.positions.clone());
    let plane = least_plane(&sphere_mesh);
    let mut stage = scene(vec![sphere_mesh], vec![Material { base_color: albedo, ..Material::default() }]);
    stage.lights = vec![Light::Sun { direction: [-0.48, -0.6, -0.64], irradiance }];
    let to_sun = [0.48, 0.6, 0.64];
    let parallel = Projection::Orthographic { height: 2.2 };
    let view = Camera { projection: parallel, ..camera([0.0, 0.0, 5.0], [0.0; 3], 1.0) };
    // Samples stay within a thousandth of a pixel around its center.
    let filter = Filter::Box(1.0 / 1024.0);
    let footprint = SQRT_2 / 1024.0 * HEIGHT / f64::from(N);
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        let film = film(&stage, &view, &Settings { integrator, filter, ..settings(N, N, 2, 0) });
        let (mut n_bright, mut n_dark) = (0, 0);
        for (index, pixel) in (0..).zip(film.pixels()) {
            let [x, y] = [index % N, index / N].map(|i| (f64::from(i) + 0.5) / f64::from(N) - 0.5);
            let (x, y) = (x * HEIGHT, -y * HEIGHT);
            // Points on triangles are closer to the center than on the sphere, so the same sine is another angle; near
            // the silhouette the slope is large.
            let far = x.hypot(y) / plane + footprint;
            if far > 0.95 {
                continue;
            }
            let error = (far - x.hypot(y)) / (1.0 - far * far).sqrt();
            let cosine = dot([x, y, (1.0 - x * x - y * y).sqrt()], to_sun);
            // If the sun is lower than twice the tilt of the triangles, it may be below their horizon, and paths fold
            // light from below that up: at most the same amount again.
            let low = 2.0 * (plane.acos().sin() + error);
            let value = pixel.mean();
            for k in 0..3 {
                let full = f64::from(albedo[k]) * f64::from(irradiance[k]) / PI;
                let bound = full * (error + 16.0 * f64::from(f32::EPSILON));
                let expected = full * cosine.max(0.0);
                let is_right = if cosine > low {
                    (value[k] - expected).abs() <= bound
                } else if cosine < -error {
                    value[k] == 0.0
                } else {
                    (0.0..=2.0 * (expected + bound)).contains(&value[k])
                };
                assert!(is_right, "{integrator:?} at {x}, {y}: {} for {expected} ± {bound}", value[k]);
            }
            n_bright += u32::from(cosine > low);
            n_dark += u32::from(cosine < -error);
        }
        assert!(n_bright > 150 && n_dark > 20, "{n_bright} {n_dark}");
    }
}

#[test]
fn surfaces_facing_away_from_a_light_are_dark() {
    let mut plane = scene(vec![floor(100.0, 0.0, 0)], vec![gray(0.5)]);
    plane.lights = vec![
        Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] },
        Light::Point { position: [0.0, 2.0, 0.0], intensity: [1.0; 3] },
    ];
    assert_eq!(probe(&plane, [0.0, -5.0, 5.0], [0.0; 3], settings(1, 1, 4, 0)), [0.0; 3]);
}

/// A shading normal that tilts towards a light below the triangle's horizon does not receive its light.
#[test]
fn light_below_the_geometric_horizon_does_not_count() {
    let mut tilted = floor(100.0, 0.0, 0);
    tilted.normals = Some(vec![[0.8, 0.6, 0.0]; 4]);
    let mut plane = scene(vec![tilted], vec![gray(0.5)]);
    let lit = |plane: &canted_scene::Scene| probe(plane, [0.0, 5.0, 5.0], [0.0; 3], settings(1, 1, 1, 0))[0];
    // The shading normal has the cosine 0.8·0.995 - 0.6·0.1 = 0.736 to the light from below, and 0.856 to that from
    // above.
    plane.lights = vec![Light::Sun { direction: [-0.995, 0.1, 0.0], irradiance: [std::f32::consts::PI; 3] }];
    // There is no occluder: the shadow ray leaves by the lower side and escapes.
    assert_eq!(lit(&plane), 0.0);
    plane.lights = vec![Light::Sun { direction: [-0.995, -0.1, 0.0], irradiance: [std::f32::consts::PI; 3] }];
    assert!(is_close(lit(&plane), 0.5 * 0.856));
}

/// A screen ends at x = 1 below a light at height 4: the shadow ends where the line through both hits the floor.
#[test]
fn shadow_ends_at_the_projected_edge() {
    let screen = parallelogram([-50.0, 1.0, -50.0], [51.0, 0.0, 0.0], [0.0, 0.0, 100.0], 0);
    let mut stage = scene(vec![floor(100.0, 0.0, 0), screen], vec![gray(0.5)]);
    let lit = |stage: &canted_scene::Scene, x: f64| {
        let x = x as f32;
        // The eye is below the screen, which never hides the floor.
        probe(stage, [x, 0.5, 0.5], [x, 0.0, 0.0], settings(1, 1, 1, 0))[0] > 0.0
    };
    stage.lights = vec![Light::Point { position: [0.0, 4.0, 0.0], intensity: [10.0; 3] }];
    let edge = 4.0 / 3.0;
    assert!(!lit(&stage, edge - 1e-3) && lit(&stage, edge + 1e-3));
    // A sun along (1, -1, 0) shifts the edge by the screen's height.
    let slant = std::f32::consts::FRAC_1_SQRT_2;
    stage.lights = vec![Light::Sun { direction: [slant, -slant, 0.0], irradiance: [1.0; 3] }];
    assert!(!lit(&stage, 2.0 - 1e-3) && lit(&stage, 2.0 + 1e-3));
}

/// A light in the plane of a ceiling is not occluded by it; a light behind a wall is.
#[test]
fn shadow_rays_end_before_the_light() {
    let mut room = scene(vec![cuboid([-5.0, 0.0, -5.0], [5.0, 4.0, 5.0], 0)], vec![gray(0.5)]);
    for (height, is_lit) in [(3.999_99, true), (4.0, true), (4.001, false)] {
        room.lights = vec![Light::Point { position: [0.3, height, 0.2], intensity: [10.0; 3] }];
        let radiance = probe(&room, [1.0, 1.0, 1.0], [0.1, 0.0, 0.0], settings(1, 1, 1, 0));
        assert_eq!(radiance[0] > 0.0, is_lit, "light at height {height}");
    }
}

/// One bounce from a red wall in the sun reddens a white floor in the shade.
#[test]
fn indirect_light_is_colored() {
    let red = Material { base_color: [0.8, 0.1, 0.1], ..Material::default() };
    // The wall at x = 0 faces +x; the roof keeps the sun off the floor near it.
    let wall = parallelogram([0.0, 0.0, -20.0], [0.0, 10.0, 0.0], [0.0, 0.0, 40.0], 1);
    let roof = parallelogram([0.5, 10.0, -20.0], [20.0, 0.0, 0.0], [0.0, 0.0, 40.0], 0);
    let mut court = scene(vec![floor(100.0, 0.0, 0), wall, roof], vec![gray(0.8), red]);
    court.lights = vec![Light::Sun { direction: [-0.1, -0.995, 0.0], irradiance: [3.0; 3] }];
    let shaded = |bounces| probe(&court, [3.0, 2.0, 4.0], [3.0, 0.0, 0.0], settings(1, 1, 256, bounces));
    assert_eq!(shaded(0), [0.0; 3]);
    let [r, g, b] = shaded(1);
    // All light of one bounce comes from the wall or from the sunlit floor far away; the wall's part is red.
    assert!(r > 1.2 * g && g > 0.0 && g == b, "{r} {g} {b}");
}

/// The error of the mean falls as `1/√n` for independent samples: four times the samples, half the error.
#[test]
fn error_falls_with_the_root_of_the_sample_count() {
    let mut room = scene(
        vec![cuboid([-2.0, 0.0, -2.0], [2.0, 3.0, 2.0], 0), cuboid([-0.5, 0.0, -0.5], [0.5, 1.0, 0.5], 0)],
        vec![gray(0.7)],
    );
    room.lights = vec![Light::Point { position: [1.5, 2.5, 1.5], intensity: [10.0; 3] }];
    let view = camera([-1.5, 2.0, 1.0], [-1.0, 0.0, 0.0], 20.0);
    let pixels = |samples, seed, pattern| {
        let film = film(&room, &view, &Settings { seed, pattern, ..settings(12, 12, samples, 2) });
        film.pixels().iter().map(|pixel| pixel.mean()[0]).collect::<Vec<_>>()
    };
    // Two independent images differ by √2 times the error of one.
    let error = |samples, pattern| {
        let (a, b) = (pixels(samples, 1, pattern), pixels(samples, 2, pattern));
        (a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 288.0).sqrt()
    };
    let (few, many) = (error(16, Pattern::Random), error(64, Pattern::Random));
    // 144 pixels give a standard deviation to 1/√288 = 6 %, the ratio of two to 8 %. The bound is four of those around
    // 2.
    assert!((few / many / 2.0 - 1.0).abs() < 0.34, "{few} {many}");
    assert!(error(16, Pattern::Stratified) < few);
}

// Energy conservation of the hybrid integrator at every depth.

/// All pixels of an image that is filled by a surface.
fn pixels(scene: &canted_scene::Scene, eye: [f32; 3], target: [f32; 3], fov: f32, bounces: u32) -> Vec<[f64; 3]> {
    let film = film(scene, &camera(eye, target, fov), &settings(12, 12, 6, bounces));
    assert_eq!(film.n_dropped(), 0);
    film.pixels().iter().map(canted_film::Pixel::mean).collect()
}

/// From a convex object every bounce escapes: each sample equals the albedo, at any depth.
#[test]
fn convex_object_in_a_white_furnace_shows_its_albedo() {
    for (object, name) in [(sphere([0.0; 3], 1.0, 3, 0), "sphere"), (cuboid([-1.0; 3], [1.0; 3], 0), "cube")] {
        let furnace = under([1.0; 3], scene(vec![object], vec![gray(0.625)]));
        for bounces in [0, 1, 3] {
            for pixel in pixels(&furnace, [2.0, 3.0, 4.0], [0.0; 3], 15.0, bounces) {
                assert_eq!(pixel, [0.625; 3], "{name}, {bounces} bounces");
            }
        }
    }
}

/// Inside a closed object that emits 1 and reflects `a`, depth `d` gives `1 + a + ... + a^d`; no sample may leak.
#[test]
fn closed_emitter_gives_the_geometric_series() {
    let glowing = Material { emission: [1.0; 3], ..gray(0.5) };
    for shell in [inside_out(sphere([0.0; 3], 1.0, 3, 0)), cuboid([-1.0; 3], [1.0, 2.0, 3.0], 0)] {
        // The environment would be visible through any leak.
        let room = under([100.0; 3], scene(vec![shell], vec![glowing.clone()]));
        for (bounces, expected) in [(0, 1.0), (1, 1.5), (2, 1.75), (5, 1.968_75)] {
            for pixel in pixels(&room, [0.1, 0.2, 0.3], [0.5, 0.1, -0.4], 100.0, bounces) {
                assert_eq!(pixel, [expected; 3], "{bounces} bounces");
            }
        }
    }
}

/// The ambient term never adds energy, for open and closed scenes and every radius.
#[test]
fn white_furnace_never_exceeds_one() {
    let bodies = vec![
        crate::common::floor(5.0, 0.0, 0),
        cuboid([-1.0, 0.0, -1.0], [0.0, 2.0, 0.0], 0),
        sphere([1.0, 0.5, 0.5], 0.5, 2, 0),
    ];
    let furnace = under([1.0; 3], scene(bodies, vec![gray(1.0)]));
    let view = camera([4.0, 3.0, 5.0], [0.0, 0.5, 0.0], 40.0);
    for bounces in 0..3 {
        let mut means = Vec::new();
        for radius in [0.01, 1.0, 100.0, f32::INFINITY] {
            let film = film(
                &furnace,
                &view,
                &canted_renderer::Settings { ao_radius: Some(radius), ..settings(24, 24, 4, bounces) },
            );
            for pixel in film.pixels() {
                assert!(pixel.mean().iter().all(|&x| (0.0..=1.0).contains(&x)), "radius {radius}: {:?}", pixel.mean());
            }
            means.push(film.pixels().iter().map(|pixel| pixel.mean()[0]).sum::<f64>() / 576.0);
        }
        // A smaller radius is brighter; with infinite radius, occluded light stays dark.
        assert!(means.windows(2).all(|pair| pair[0] > pair[1]) && means[3] < 0.99, "{means:?}");
    }
}

/// Shading normals that differ from the geometric normals lose no energy and let no ray into the object.
#[test]
fn smooth_normals_conserve_energy() {
    let mut object = sphere([0.0; 3], 1.0, 1, 0);
    object.normals = Some(object.positions.clone());
    let furnace = under([1.0; 3], scene(vec![object], vec![gray(0.75)]));
    for pixel in pixels(&furnace, [2.0, 3.0, 4.0], [0.0; 3], 10.0, 2) {
        assert_eq!(pixel, [0.75; 3]);
    }
}

/// Under a mirroring, shearing and stretching transform, a convex object is still convex and the result still exact.
#[test]
fn instances_conserve_energy() {
    let sheared = Affine { columns: [[-2.0, 0.3, 0.0], [0.5, 0.7, 0.2], [0.0, -0.4, 1.5], [10.0, 20.0, -30.0]] };
    assert!(sheared.determinant() < 0.0);
    let mut furnace = scene(vec![sphere([0.0; 3], 1.0, 3, 0)], vec![gray(0.625)]);
    furnace.instances = vec![place(0, sheared)];
    furnace.environment = Some([1.0; 3].into());
    for pixel in pixels(&furnace, [10.0, 24.0, -22.0], [10.0, 20.0, -30.0], 4.0, 2) {
        assert_eq!(pixel, [0.625; 3]);
    }
}
