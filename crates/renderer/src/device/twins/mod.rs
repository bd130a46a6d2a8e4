//! Functions of kernels beside those of the CPU, each over a buffer of inputs.

mod bsdf;
mod incoming;
mod light;

use bytemuck::Pod;
use canted_fixtures::or_skip;
use canted_gpu::{Choice, Gpu, NamedBinding, Specialisation};

use crate::{Pattern, Sampler};

/// Half a unit in the last place of 1: what one rounding changes at most, relative.
const U: f64 = 0.5 * f32::EPSILON as f64;

/// The best adapter, or the sentence of a skipped test.
fn gpu(test: &str) -> Option<Gpu> {
    or_skip(test, Gpu::open(&Choice::Best))
}

/// What a kernel of `check/` writes into `answers` for each of `queries`.
fn answers<Q: Pod, A: Pod>(
    gpu: &Gpu,
    kernel: &str,
    chosen: &Specialisation,
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
    commands.run().unwrap();
    gpu.read(&answers).unwrap()
}

/// How many answers were the CPU's, and how many lay at an edge of choices; else what is wrong with the first.
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

/// Members of the Rust structure and their offsets, as the kernel's structure of that name has them.
macro_rules! same_layout {
    ($kernel:expr, $chosen:expr, $name:literal, $ty:ty { $($member:ident),* $(,)? }) => {{
        let shader = canted_shaders::Shader::new($kernel, $chosen).unwrap();
        let layout = shader.layout($name).unwrap();
        let members = [$((stringify!($member).to_owned(), std::mem::offset_of!($ty, $member))),*];
        let found: Vec<(String, usize)> = layout.members.iter().map(|(name, at)| (name.clone(), *at as usize)).collect();
        assert_eq!((found.as_slice(), layout.size as usize), (members.as_slice(), size_of::<$ty>()));
    }};
}
use same_layout;
