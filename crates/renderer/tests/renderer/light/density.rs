//! Light samples follow their PDF, for all kinds of lights at once.

use std::f64::consts::{PI, TAU};

use canted_renderer::{LightId, LightSampler, Surface, Tracer};
use canted_scene::{Light, Scene};
use canted_trace::Ray;

use super::environment::sunny;
use super::{emissive, numbers, receiver, with_sampler};
use crate::chi_square::deviation;
use crate::common::{BruteForce, narrow, parallelogram, scene};

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
fn counts(sampler: &LightSampler) -> Vec<f64> {
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
    let hit = tracer.closest_hit(&ray, &mut ());
    let of = |light| sampler.density(&from(), false, direction, light);
    let shape_light =
        sampler.lights().intersect(&ray, None).map(|hit| hit.light).filter(|light| *light != LightId::Environment);
    of(LightId::Environment) + shape_light.map_or(0.0, of) + hit.map_or(0.0, |hit| of(LightId::of_hit(&hit)))
}

fn expected(sampler: &LightSampler, scene: &Scene) -> Vec<f64> {
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
const LIMIT: f64 = 6.0;

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
