//! Random numbers: the same bits on both devices.

use bytemuck::{Pod, Zeroable};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, Variant};
use canted_renderer::{Pattern, Sampler};

use super::gpu;

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(random_numbers_have_the_same_bits)]
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Ask {
    pixel: u32,
    sample: u32,
    dimension: u32,
    seed: u32,
    columns: u32,
    rows: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
struct Answer {
    pair: [f32; 2],
    single: f32,
    bits: u32,
}

fn of_device(gpu: &Gpu, pattern: &str, asks: &[Ask]) -> Vec<Answer> {
    let part = Variant::none().part("pattern", &format!("shared/sampler/pattern/{pattern}"));
    let kernel = gpu.kernel("check/sampler", &part).unwrap();
    let asked = gpu.buffer("queries", asks).unwrap();
    let answers = gpu.zeroed::<Answer>("answers", asks.len()).unwrap();
    let mut commands = gpu.commands();
    let groups = kernel.groups(u32::try_from(asks.len()).unwrap());
    commands.dispatch(&kernel, &[("queries", &asked), ("answers", &answers)], groups).unwrap();
    commands.run().unwrap();
    gpu.read(&answers).unwrap()
}

/// A hash unrelated to the sampler's.
fn scattered(i: u32, salt: u32) -> u32 {
    (i ^ salt.wrapping_mul(0x9e37_79b1)).wrapping_mul(0x85eb_ca6b).rotate_left(13).wrapping_mul(0xc2b2_ae35)
}

fn random_numbers_have_the_same_bits() {
    let gpu = gpu();
    let counts = [1, 2, 3, 7, 16, 24, 97, 256, 1000, 4096, 65_535, 1 << 20];
    for (name, pattern) in [("random", Pattern::Random), ("stratified", Pattern::Stratified), ("sobol", Pattern::Sobol)]
    {
        let mut asks = vec![];
        let mut answers = vec![];
        for n in counts {
            for i in 0..200 {
                let [pixel, dimension, seed] = [1, 2, 3].map(|salt| scattered(i, salt) >> (i % 32));
                // Beyond the sample count, too.
                let sample = scattered(i, 4) % (n + n / 2 + 1);
                let sampler = Sampler::new(pattern, n, seed);
                answers.push(Answer {
                    pair: sampler.pair(pixel, sample, dimension),
                    single: sampler.single(pixel, sample, dimension),
                    bits: sampler.bits(pixel, sample, dimension),
                });
                let [columns, rows] = sampler.grid();
                asks.push(Ask { pixel, sample, dimension, seed, columns, rows });
            }
        }
        let found = of_device(&gpu, name, &asks);
        for (i, (found, expected)) in found.iter().zip(&answers).enumerate() {
            assert_eq!(found, expected, "{name}, ask {i}");
        }
        // The check detects a single bit.
        asks[17].seed ^= 1 << 31;
        assert_ne!(of_device(&gpu, name, &asks[17..18])[0], answers[17]);
    }
}
