//! The sort compared with the stable sort of the CPU.

use canted_fixtures::SplitMix64;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{
    Gpu,
    build::{BuildEncoder, Sorter},
};
use canted_lbvh::{Bits, sort_by_code};

use crate::setup::{gpu, words};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(the_sort_is_stable_across_sizes_and_duplicates),
        needs_device(a_million_pairs_are_sorted_stably),
        needs_device(the_comparison_detects_one_wrong_bit),
    ]
}

/// `n` codes of 63 bits with `distinct` values.
fn codes(n: usize, distinct: usize) -> Vec<u64> {
    let mut rng = SplitMix64::new(n as u64);
    (0..n).map(|_| (rng.below(distinct) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 1).collect()
}

fn sorted(gpu: &Gpu, sorter: &Sorter, codes: &[u64]) -> Vec<u32> {
    let [low, high] = words(codes.iter()).map(|word| gpu.buffer("codes", &word).unwrap());
    gpu.read(&sorter.sort(&mut BuildEncoder::new(gpu), &[(&low, 32), (&high, 31)]).unwrap()).unwrap()
}

fn sorted_by_cpu(codes: &[u64]) -> Vec<u32> {
    sort_by_code(codes, Bits::B63).leaves.iter().map(|leaf| leaf.0).collect()
}

fn the_sort_is_stable_across_sizes_and_duplicates() {
    let gpu = gpu();
    let sorter = Sorter::new(&gpu).unwrap();
    for n in [0, 1, 2, 255, 256, 257, 1023, 1024, 1025, 70_000] {
        for distinct in [1, 3, 1 << 40] {
            let codes = codes(n, distinct);
            assert_eq!(sorted(&gpu, &sorter, &codes), sorted_by_cpu(&codes), "{n} codes, {distinct} distinct");
        }
    }
}

/// A million pairs, which take several slices of items: short codes with many duplicates, and long ones with few.
fn a_million_pairs_are_sorted_stably() {
    let gpu = gpu();
    let sorter = Sorter::new(&gpu).unwrap();
    for distinct in [1000, 1 << 40] {
        let codes = codes(1 << 20, distinct);
        assert!(sorted(&gpu, &sorter, &codes) == sorted_by_cpu(&codes), "{distinct} distinct");
    }
}

fn the_comparison_detects_one_wrong_bit() {
    let gpu = gpu();
    let sorter = Sorter::new(&gpu).unwrap();
    let codes = codes(1000, 1 << 40);
    let mut other = codes.clone();
    other[500] ^= 1 << 62;
    assert_ne!(sorted(&gpu, &sorter, &other), sorted_by_cpu(&codes));
}
