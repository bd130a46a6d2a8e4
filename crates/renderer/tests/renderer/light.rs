//! Tests of lights against closed forms, quadrature in `f64` and sample counts.
//!
//! Not covered: lights with negative or NaN colors, which the readers reject.

use std::f64::consts::{PI, TAU};

use canted_film::Pixel;
use canted_renderer::{
    Bsdf, Cone, Integrator, LightId, LightSampler, Lights, Pattern, Sampler, Settings, Surface, Surfaces,
};
use canted_scene::{Camera, Light, Material, Projection, Scene};
use canted_trace::{Hit, InstanceId, Intersect, Ray, Side};

use crate::common::{
    BruteForce, Vector, camera, deviation, dot, film, floor, gray, mesh, narrow, parallelogram, probe, scene, settings,
    sub,
};
use crate::environment::{lambert, sunny};

/// A surface that receives light.
pub(crate) fn receiver(position: Vector, normal: Vector) -> Surface {
    Surface {
        position,
        normal,
        shading_normal: normal,
        smooth: None,
        is_front: true,
        bsdf: Bsdf::lambert([1.0; 3]),
        along: None,
        emission: [0.0; 3],
        offset: 1e-6,
        cone: Cone::ZERO,
        time: 0.0,
    }
}

/// Independent random numbers for the choice of the light and for its sample.
pub(crate) fn numbers(n: u32) -> impl Iterator<Item = (f32, [f32; 2])> {
    let sampler = Sampler::new(Pattern::Random, n, 7);
    (0..n).map(move |i| (sampler.single(i, 0, 0), sampler.pair(i, 0, 1)))
}

/// Sample mean and its standard error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate {
    pub(crate) mean: f64,
    pub(crate) error: f64,
}

impl Estimate {
    pub(crate) fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for value in values {
            n += 1.0;
            sum += value;
            squares += value * value;
        }
        let (mean, square): (f64, f64) = (sum / n, squares / n);
        Self { mean, error: ((square - mean * mean).max(0.0) / n).sqrt() }
    }

    /// Within five standard errors plus the rounding error of `f32` samples.
    pub(crate) fn matches(&self, expected: f64) -> bool {
        (self.mean - expected).abs() <= 5.0 * self.error + 16.0 * f64::from(f32::EPSILON) * expected
    }
}

pub(crate) fn with_sampler<R>(scene: &Scene, test: impl FnOnce(&LightSampler) -> R) -> R {
    let surfaces = Surfaces::new(scene);
    test(&LightSampler::new(Lights::new(scene), &surfaces))
}

/// Red irradiance at a point from all lights of a scene, without occlusion.
pub(crate) fn irradiance(scene: &Scene, from: &Surface, n: u32) -> Estimate {
    with_sampler(scene, |sampler| {
        Estimate::of(numbers(n).map(|(choice, square)| {
            sampler.sample(from, false, choice, square).map_or(0.0, |sample| {
                let cosine = dot(from.shading_normal, sample.to_light.map(f64::from)).max(0.0);
                f64::from(sample.radiance[0]) * cosine
            })
        }))
    })
}

pub(crate) fn emissive(radiance: f32) -> Material {
    Material { emission: [radiance; 3], ..Material::default() }
}

// Light samples follow their PDF, for all kinds of lights at once.

const RINGS: usize = 16;
const SECTORS: usize = 32;
const N: u32 = 100_000;

/// A sphere light, a disk light and an emissive square around the origin, an environment map with a sun, and a point
/// light and a sun light, which have no PDF. No light occludes another.
fn all_lights() -> Scene {
    let lamp = parallelogram([1.5, 1.0, -1.0], [0.5, 0.0, 1.0], [0.0, 1.5, 0.2], 0);
    let mut scene = scene(vec![lamp], vec![emissive(5.0)]);
    scene.environment = Some(canted_scene::Environment::Image(sunny(20.0)));
    scene.lights = vec![
        Light::Point { position: [0.0, 3.0, -3.0], intensity: [8.0; 3] },
        Light::Sphere { center: [-2.0, 2.0, 1.0], radius: 1.2, radiance: [3.0; 3] },
        Light::Sun { direction: [0.0, -0.8, 0.6], irradiance: [3.0; 3] },
        Light::Disk { center: [0.0, 2.0, -2.0], normal: [0.0, -0.8, 0.6], radius: 0.8, radiance: [6.0; 3] },
    ];
    scene
}

fn from() -> Surface {
    receiver([0.1, 0.2, 0.0], [0.0, 1.0, 0.0])
}

fn cell([x, y, z]: [f64; 3]) -> usize {
    let (polar, azimuth) = (y.clamp(-1.0, 1.0).acos() / PI, z.atan2(x) / TAU + 0.5);
    let (ring, sector) = ((polar * RINGS as f64) as usize, (azimuth * SECTORS as f64) as usize);
    ring.min(RINGS - 1) * SECTORS + sector.min(SECTORS - 1)
}

/// Sample counts by direction; the last cell counts the remaining samples.
pub(crate) fn counts(sampler: &LightSampler) -> Vec<f64> {
    let mut counts = vec![0.0; RINGS * SECTORS + 1];
    for (choice, square) in numbers(N) {
        let sample = sampler.sample(&from(), false, choice, square).filter(|sample| !sample.is_delta);
        counts[sample.map_or(RINGS * SECTORS, |sample| cell(sample.to_light.map(f64::from)))] += 1.0;
    }
    counts
}

/// The PDF of a direction: the sum over the environment and each light that the ray hits.
fn density(sampler: &LightSampler, tracer: &BruteForce, direction: [f32; 3]) -> f32 {
    let ray = Ray::new(narrow(from().position), direction);
    let hit = tracer.closest_hit(&ray);
    let of = |light| sampler.density(&from(), false, direction, light);
    let shape_light =
        sampler.lights().intersect(&ray, None).map(|hit| hit.light).filter(|light| *light != LightId::Environment);
    of(LightId::Environment) + shape_light.map_or(0.0, of) + hit.map_or(0.0, |hit| of(LightId::of_hit(&hit)))
}

pub(crate) fn expected(sampler: &LightSampler, scene: &Scene) -> Vec<f64> {
    const FINE: usize = 24;
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let tracer = BruteForce::new(scene);
    let mut cells = vec![0.0; RINGS * SECTORS + 1];
    for i in 0..RINGS * FINE {
        for j in 0..SECTORS * FINE {
            let (sine, y) = ((i as f64 + (j as f64 * GOLDEN).fract()) / (RINGS * FINE) as f64 * PI).sin_cos();
            let (s, c) = (((j as f64 + 0.5) / (SECTORS * FINE) as f64 - 0.5) * TAU).sin_cos();
            let area = sine * PI * TAU / ((RINGS * SECTORS * FINE * FINE) as f64);
            let direction = [sine * c, y, sine * s];
            cells[i / FINE * SECTORS + j / FINE] += f64::from(density(sampler, &tracer, narrow(direction))) * area;
        }
    }
    cells[RINGS * SECTORS] = 1.0 - cells.iter().sum::<f64>();
    cells
}

/// Six standard deviations: false alarms are practically impossible, and quadrature errors at the edges of lights are
/// smaller.
pub(crate) const LIMIT: f64 = 6.0;

#[test]
fn samples_match_pdf() {
    let scene = all_lights();
    with_sampler(&scene, |sampler| {
        let deviation = deviation(&counts(sampler), &expected(sampler, &scene));
        assert!(deviation < LIMIT, "{deviation}");
    });
}

/// The test above detects a light that is slightly brighter or larger.
#[test]
fn test_detects_wrong_pdfs() {
    let correct = with_sampler(&all_lights(), counts);
    let mut brighter = all_lights();
    brighter.materials = vec![emissive(6.0)];
    let mut larger = all_lights();
    larger.lights[1] = Light::Sphere { center: [-2.0, 2.0, 1.0], radius: 1.25, radiance: [3.0; 3] };
    for wrong in [brighter, larger] {
        let deviation = with_sampler(&wrong, |sampler| deviation(&correct, &expected(sampler, &wrong)));
        assert!(deviation > LIMIT, "{deviation}");
    }
}

/// Rounding of a direction changes the cosine at a planar light by one rounding. The PDF depends on its cube: 30
/// roundings at a cosine of 0.1, the minimum here. Both PDFs and their quotient add one rounding each.
const DENSITY_ERROR: f32 = 33.0 * 0.5 * f32::EPSILON;

/// The PDF of a sample matches the PDF evaluated for its direction, except where rounding decides between texels.
#[test]
fn sample_pdf_matches_evaluated_pdf() {
    with_sampler(&all_lights(), |sampler| {
        for transmits in [false, true] {
            for (choice, square) in numbers(2000) {
                let Some(sample) = sampler.sample(&from(), transmits, choice, square) else { continue };
                let density = sampler.density(&from(), transmits, sample.to_light, sample.light);
                let is_close = (density / sample.density - 1.0).abs() <= DENSITY_ERROR;
                assert!(is_close || (sample.is_delta && density == 0.0), "{sample:?} {density}");
            }
        }
    });
}

// Light sampling with many lights.

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

// Sphere and disk lights: intersection, occlusion, penumbras.

const SPHERE: Light = Light::Sphere { center: [0.0, 5.0, 0.0], radius: 1.0, radiance: [3.0; 3] };
const DISK: Light = Light::Disk { center: [0.0, 9.0, 0.0], normal: [0.0, -1.0, 0.0], radius: 2.0, radiance: [4.0; 3] };

fn lit_by(lights: Vec<Light>) -> Scene {
    Scene { lights, ..scene(vec![floor(50.0, 0.0, 0)], vec![gray(0.5)]) }
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
    let mut stage = scene(vec![floor(50.0, 0.0, 0), screen], vec![gray(0.5)]);
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
    let stage = Scene { lights: vec![light], ..scene(vec![floor(50.0, 0.0, 0), screen], vec![gray(0.5)]) };
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
