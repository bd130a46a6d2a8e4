//! Sphere and disk lights: intersection, occlusion, penumbras.

use std::f64::consts::{PI, TAU};

use canted_film::Pixel;
use canted_renderer::{Integrator, LightId, Lights, Pattern, Settings};
use canted_scene::{Camera, Light, Projection, Scene};
use canted_trace::{Hit, InstanceId, Ray, Side};

use crate::common::{BruteForce, Vector, camera, film, floor, grey, parallelogram, probe, scene, settings};

const SPHERE: Light = Light::Sphere { center: [0.0, 5.0, 0.0], radius: 1.0, radiance: [3.0; 3] };
const DISK: Light = Light::Disk { center: [0.0, 9.0, 0.0], normal: [0.0, -1.0, 0.0], radius: 2.0, radiance: [4.0; 3] };

fn lit_by(lights: Vec<Light>) -> Scene {
    Scene { lights, ..scene(vec![floor(50.0, 0.0, 0)], vec![grey(0.5)]) }
}

fn hit_at(t: f32) -> Hit {
    Hit { t, u: 0.3, v: 0.3, primitive: canted_obb::PrimId(0), instance: InstanceId(0), side: Side::Front }
}

#[test]
fn closest_light_within_the_closed_interval_is_hit() {
    let scene = lit_by(vec![DISK, SPHERE]);
    let lights = Lights::new(&scene);
    let up = Ray::new([0.0; 3], [0.0, 2.0, 0.0]);
    let visible = |ray: Ray, hit: Option<f32>| {
        lights.intersect(&ray, hit.map(hit_at).as_ref()).map(|hit| (hit.light, hit.radiance))
    };
    assert_eq!(visible(up, None), Some((LightId::Light(1), [3.0; 3])));
    // The sphere begins at a distance of 4, t = 2.
    assert_eq!(visible(up, Some(2.0)), Some((LightId::Light(1), [3.0; 3])));
    assert_eq!(visible(up, Some(1.999)), None);
    assert_eq!(visible(Ray { t_max: 2.0, ..up }, None), Some((LightId::Light(1), [3.0; 3])));
    // Spheres are black from inside, disks from behind.
    let above = Ray { origin: [0.0, 6.5, 0.0], ..up };
    assert_eq!(visible(above, None), Some((LightId::Light(0), [4.0; 3])));
    assert_eq!(visible(Ray { origin: [0.0, 5.0, 0.0], ..up }, None), Some((LightId::Light(1), [0.0; 3])));
    let down = Ray::new([0.0, 20.0, 0.0], [0.0, -0.5, 0.0]);
    assert_eq!(visible(down, None), Some((LightId::Light(0), [0.0; 3])));
    // The edge belongs to the disk; rays in its plane miss.
    assert_eq!(visible(Ray { origin: [2.0, 8.0, 0.0], ..up }, None), Some((LightId::Light(0), [4.0; 3])));
    assert_eq!(visible(Ray { origin: [2.000_001, 8.0, 0.0], ..up }, None), Some((LightId::Environment, [0.0; 3])));
    assert_eq!(visible(Ray::new([-5.0, 9.0, 0.0], [1.0, 0.0, 0.0]), None), Some((LightId::Environment, [0.0; 3])));
}

#[test]
fn shape_lights_occlude_other_lights_but_not_themselves() {
    let scene = lit_by(vec![DISK, SPHERE]);
    let (lights, tracer) = (Lights::new(&scene), BruteForce::new(&scene));
    let is_unoccluded = |ray: Ray, to| lights.is_unoccluded(&ray, to, &tracer, &mut ());
    let up = Ray { t_max: 8.8, ..Ray::new([0.0, 0.1, 0.0], [0.0, 1.0, 0.0]) };
    assert!(!is_unoccluded(up, LightId::Light(0)) && is_unoccluded(up, LightId::Light(1)));
    assert!(!is_unoccluded(Ray { origin: [0.0, -0.1, 0.0], ..up }, LightId::Light(1)), "the floor");
    assert!(!is_unoccluded(Ray { t_max: f32::INFINITY, ..up }, LightId::Environment));
    assert!(is_unoccluded(Ray { origin: [1.5, 0.1, 0.0], ..up }, LightId::Light(0)));
}

/// Cameras see shape lights, and their light counts once: more bounces between a plane and a light add nothing.
#[test]
fn shape_lights_are_counted_once() {
    for light in [SPHERE, DISK] {
        let stage = lit_by(vec![light]);
        let radiance =
            probe(&stage, [0.0, 1.0, 3.0], [0.0, if light == SPHERE { 5.0 } else { 9.0 }, 0.0], settings(1, 1, 1, 2));
        assert_eq!(radiance, [if light == SPHERE { 3.0 } else { 4.0 }; 3]);
        let floor = |bounces| probe(&stage, [4.0, 2.0, 4.0], [1.0, 0.0, 0.0], settings(1, 1, 64, bounces));
        assert_eq!(floor(0), floor(3));
        assert!(floor(0)[0] > 0.0);
    }
}

/// `ρ·L·r²/d²·cosθ` below the sphere, and an eclipse of the sun behind it.
#[test]
fn sphere_illuminates_and_occludes() {
    let at = |lights: Vec<Light>, x: f32| {
        let samples = Settings { pattern: Pattern::Random, ..settings(1, 1, 4096, 0) };
        probe(&lit_by(lights), [x, 0.5, 2.0], [x, 0.0, 0.0], samples)[0]
    };
    for x in [0.0_f32, 3.0] {
        let square = f64::from(x).powi(2) + 25.0;
        let expected = 0.5 * 3.0 * 5.0 / square.powf(1.5);
        // Cosine and PDF vary by less than half over the sphere: five standard errors of 4096 samples.
        assert!((at(vec![SPHERE], x) / expected - 1.0).abs() < 5.0 * 0.5 / 64.0, "{x}");
    }
    let sun = Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [30.0; 3] };
    let [dark, alone, lit] = [at(vec![SPHERE, sun], 0.9), at(vec![SPHERE], 0.9), at(vec![SPHERE, sun], 1.1)];
    assert!(dark == alone && lit > alone + 4.0, "{dark} {alone} {lit}");
}

/// A half plane ends at x = 0 below a disk light: its penumbra compared with quadrature.
#[test]
fn disk_penumbra_matches_quadrature() {
    let screen = parallelogram([-60.0, 2.0, -60.0], [60.0, 0.0, 0.0], [0.0, 0.0, 120.0], 0);
    let mut stage = scene(vec![floor(50.0, 0.0, 0), screen], vec![grey(0.5)]);
    let (height, radius) = (4.0, 1.0);
    stage.lights =
        vec![Light::Disk { center: [0.0, 4.0, 0.0], normal: [0.0, -1.0, 0.0], radius: 1.0, radiance: [10.0; 3] }];
    // Past an edge at half the height, the part of the disk at x > -position is visible.
    let expected = |position: f64| {
        const STEPS: u32 = 400;
        let mut sum = 0.0;
        for i in 0..STEPS {
            let r = radius * (f64::from(i) + 0.5) / f64::from(STEPS);
            for j in 0..STEPS {
                let (s, c) = (TAU * (f64::from(j) + 0.5) / f64::from(STEPS)).sin_cos();
                let (x, z) = (r * c, r * s);
                let square = (x - position).powi(2) + z * z + height * height;
                sum += if x > -position { r * (height / square).powi(2) } else { 0.0 };
            }
        }
        0.5 / PI * 10.0 * sum * radius / f64::from(STEPS) * TAU / f64::from(STEPS)
    };
    let mut before = 0.0;
    for position in [-1.1_f32, -0.9, -0.5, 0.0, 0.5, 0.9, 1.1] {
        let samples = Settings { pattern: Pattern::Random, ..settings(1, 1, 4096, 0) };
        let value = probe(&stage, [position, 0.5, 0.5], [position, 0.0, 0.0], samples)[0];
        let expected = expected(position.into());
        // A visible fraction p has the variance p(1 - p) <= 1/4 of the total, which is below 0.35; the edge of the
        // quadrature crosses one of 400 steps.
        assert!((value - expected).abs() < 5.0 * 0.35 * 0.5 / 64.0 + 0.35 / 400.0, "{position}: {value} {expected}");
        assert!(value >= before - 0.02 && (position > -1.0 || value == 0.0), "{position}: {value}");
        before = value;
    }
}

/// A row of 33 pixels on the floor below a screen that ends at x = 1 and y = 1. A light at a height of 4 casts a shadow
/// up to x = 4/3, the center of the middle pixel. Pixels are 1/30 wide.
fn shadow_of(light: Light, integrator: Integrator) -> Vec<Vector> {
    let screen = parallelogram([-50.0, 1.0, -50.0], [51.0, 0.0, 0.0], [0.0, 0.0, 100.0], 0);
    let stage = Scene { lights: vec![light], ..scene(vec![floor(50.0, 0.0, 0), screen], vec![grey(0.5)]) };
    let edge = 4.0 / 3.0;
    // Below the screen, so that nothing occludes the view.
    let view = camera([edge, 0.9, 0.0], [edge, 0.0, 0.0], 1.0);
    let view = Camera { projection: Projection::Orthographic { height: 1.0 / 30.0 }, ..view };
    let film = film(&stage, &view, &Settings { integrator, ..settings(33, 1, 64, 0) });
    film.pixels().iter().map(Pixel::mean).collect()
}

/// A sphere light with a radius of a ten-thousandth of its distance matches a point light of equal power and its hard
/// shadow.
#[test]
fn tiny_sphere_matches_point_light() {
    const INTENSITY: f32 = 10.0;
    let center = [0.0, 4.0, 0.0];
    let point = Light::Point { position: center, intensity: [INTENSITY; 3] };
    let sphere = |radius: f32| {
        let radiance = [INTENSITY / (std::f32::consts::PI * radius * radius); 3];
        Light::Sphere { center, radius, radiance }
    };
    // Directions differ by at most r/d, cosines by at most tanθ times that; tanθ is below 1/2 up to x = 2. Radiance and
    // pixel value take about sixteen roundings.
    let is_close = |value: Vector, expected: Vector| {
        let bound = 0.5 * 1e-4 + 16.0 * f64::from(f32::EPSILON);
        (0..3).all(|k| (value[k] - expected[k]).abs() <= bound * expected[k])
    };
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        let hard = shadow_of(point, integrator);
        let small = shadow_of(sphere(4e-4), integrator);
        let lit = hard[17][0];
        for (column, (&hard, &small)) in hard.iter().zip(&small).enumerate() {
            // The penumbra is a third of the sphere's width, within the middle pixel.
            match column {
                0..16 => assert_eq!((hard, small), ([0.0; 3], [0.0; 3]), "{integrator:?}, column {column}"),
                16 => assert!([hard, small].iter().all(|value| value[0] > 0.0 && value[0] < lit), "{hard:?} {small:?}"),
                _ => assert!(
                    is_close(small, hard) && hard[0] > 0.0,
                    "{integrator:?}, column {column}: {small:?} {hard:?}"
                ),
            }
        }
        // A sphere with a radius of a fortieth of its distance has a penumbra two pixels wide.
        let wide = shadow_of(sphere(0.1), integrator);
        assert!(wide[15][0] > 0.0 && !is_close(wide[17], hard[17]), "{integrator:?}: {wide:?}");
    }
}
