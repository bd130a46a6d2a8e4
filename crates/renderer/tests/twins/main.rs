//! Compares shader functions with their CPU twins, over a buffer of inputs. Ignored without an adapter.

mod bsdf;
mod hair;
mod incoming;
mod light;

use std::process::ExitCode;

use bytemuck::Pod;
use canted_fixtures::device_tests;
use canted_gpu::{Choice, Gpu, NamedBinding, Variant, block_on};
use canted_renderer::{Bsdf, Cone, Pattern, Sampler, Surface};

fn main() -> ExitCode {
    device_tests::run(
        block_on(Gpu::open(&Choice::Best)),
        [bsdf::tests(), hair::tests(), incoming::tests(), light::tests()],
    )
}

/// Half a ULP of 1: the maximum relative error of one rounding.
const U: f64 = 0.5 * f32::EPSILON as f64;

/// The best adapter.
fn gpu() -> Gpu {
    block_on(Gpu::open(&Choice::Best)).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs a kernel of `check/`: its `answers` for `queries`.
fn answers<Q: Pod, A: Pod>(
    gpu: &Gpu,
    kernel: canted_gpu::ShaderName,
    chosen: &Variant,
    queries: &[Q],
    others: &[NamedBinding<'_>],
) -> Vec<A> {
    let kernel = gpu.kernel(kernel, chosen).unwrap();
    let asked = gpu.buffer("queries", queries).unwrap();
    let answers = gpu.zeroed::<A>("answers", queries.len()).unwrap();
    let mut bound: Vec<NamedBinding<'_>> = vec![("queries", &asked), ("answers", &answers)];
    bound.extend(others);
    let mut commands = gpu.commands();
    commands.dispatch(&kernel, &bound, kernel.groups(u32::try_from(queries.len()).unwrap())).unwrap();
    block_on(commands.run()).unwrap();
    block_on(gpu.read(&answers)).unwrap()
}

/// Number of answers that match the CPU's, and number of those at a discontinuity; or what is wrong with the first.
fn compare<Q, A>(
    one: impl Fn(&Q, &A) -> Result<bool, String>,
    queries: &[Q],
    answers: &[A],
) -> Result<[usize; 2], String> {
    let compared: Vec<_> = queries.iter().zip(answers).map(|(query, answer)| one(query, answer)).collect();
    let wrong: Vec<_> = compared.iter().filter_map(|result| result.as_ref().err()).collect();
    if let Some(first) = wrong.first() {
        return Err(format!("{first}; {} of {} are wrong", wrong.len(), queries.len()));
    }
    let n_equal = compared.iter().filter(|result| matches!(result, Ok(true))).count();
    Ok([n_equal, queries.len() - n_equal])
}

/// A number in `[0, 1)` for each pair of indices.
fn number(i: u32, k: u32) -> f32 {
    Sampler::new(Pattern::Random, 1, 1).single(i, 0, k)
}

/// A unit vector for each pair of indices.
fn direction(i: u32, k: u32) -> [f32; 3] {
    let z = 2.0 * number(i, k) - 1.0;
    let (s, c) = (std::f32::consts::TAU * number(i, k + 1)).sin_cos();
    let r = ((1.0 - z) * (1.0 + z)).sqrt();
    [r * c, r * s, z]
}

/// Whether each component of `a` is within `bound` of that of `b`.
fn are_near(a: [f32; 3], b: [f64; 3], bound: f64) -> bool {
    (0..3).all(|k| (f64::from(a[k]) - b[k]).abs() <= bound)
}

/// A receiver of light that scatters half of it.
fn surface(position: [f32; 3], normal: [f32; 3], shading_normal: [f32; 3]) -> Surface {
    Surface {
        position: position.map(f64::from),
        normal: normal.map(f64::from),
        shading_normal: shading_normal.map(f64::from),
        smooth: None,
        is_front: true,
        bsdf: Bsdf::lambert([0.5; 3]),
        along: None,
        emission: [0.0; 3],
        offset: 0.0,
        cone: Cone::ZERO,
        time: 0.0,
    }
}
