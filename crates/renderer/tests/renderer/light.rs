//! Tests of lights against closed forms, quadrature in `f64` and sample counts.
//!
//! Not covered: lights with negative or NaN colors, which the readers reject.

mod density;
mod environment;
mod irradiance;
mod selection;
mod shape_lights;

use canted_renderer::{Bsdf, Cone, LightSampler, Lights, Pattern, Sampler, Surface, Surfaces};
use canted_scene::{Material, Scene};

use crate::common::{Vector, dot};

/// A surface that receives light.
fn receiver(position: Vector, normal: Vector) -> Surface {
    Surface {
        position,
        normal,
        shading_normal: normal,
        is_front: true,
        bsdf: Bsdf::lambert([1.0; 3]),
        along: None,
        emission: [0.0; 3],
        offset: 1e-6,
        cone: Cone::ZERO,
    }
}

/// Independent random numbers for the choice of the light and for its sample.
fn numbers(n: u32) -> impl Iterator<Item = (f32, [f32; 2])> {
    let sampler = Sampler::new(Pattern::Random, n, 7);
    (0..n).map(move |i| (sampler.single(i, 0, 0), sampler.pair(i, 0, 1)))
}

/// Sample mean and its standard error.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    mean: f64,
    error: f64,
}

impl Estimate {
    fn of(values: impl Iterator<Item = f64>) -> Self {
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
    fn matches(&self, expected: f64) -> bool {
        (self.mean - expected).abs() <= 5.0 * self.error + 16.0 * f64::from(f32::EPSILON) * expected
    }
}

fn with_sampler<R>(scene: &Scene, test: impl FnOnce(&LightSampler) -> R) -> R {
    let surfaces = Surfaces::new(scene);
    test(&LightSampler::new(Lights::new(scene), &surfaces))
}

/// Red irradiance at a point from all lights of a scene, without occlusion.
fn irradiance(scene: &Scene, from: &Surface, n: u32) -> Estimate {
    with_sampler(scene, |sampler| {
        Estimate::of(numbers(n).map(|(choice, square)| {
            sampler.sample(from, false, choice, square).map_or(0.0, |sample| {
                let cosine = dot(from.shading_normal, sample.to_light.map(f64::from)).max(0.0);
                f64::from(sample.radiance[0]) * cosine
            })
        }))
    })
}

fn emissive(radiance: f32) -> Material {
    Material { emission: [radiance; 3], ..Material::default() }
}
