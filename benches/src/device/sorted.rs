//! The radix sort alone.

use std::fmt::Write;

use anyhow::Result;
use canted_fixtures::SplitMix64;
use canted_gpu::{
    Buffer,
    build::{BuildEncoder, Sorter},
};

use super::Bench;

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    out.push_str(
        "\n### Sort\n\nStable sort of random keys with their indices; million pairs per second.\n\n\
         | pairs | keys of 30 bits | keys of 63 bits |\n| --- | --- | --- |\n",
    );
    let sorter = Sorter::new(&bench.gpu)?;
    for &log2 in bench.scale.sorted {
        let mut rng = SplitMix64::new(u64::from(log2));
        #[expect(clippy::cast_possible_truncation, reason = "any bits will do")]
        let mut word = || -> Vec<u32> { (0..1u32 << log2).map(|_| rng.below(1 << 32) as u32).collect() };
        let [low, high] = [word(), word()].map(|words| bench.gpu.buffer("keys", &words));
        let (low, high) = (low?, high?);
        let narrow = rate(bench, &sorter, &[(&low, 30)])?;
        let wide = rate(bench, &sorter, &[(&low, 32), (&high, 31)])?;
        let _ = writeln!(out, "| 2^{log2} | {narrow:.1} | {wide:.1} |");
    }
    Ok(())
}

/// Million pairs per second.
#[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
fn rate(bench: &Bench, sorter: &Sorter, words: &[(&Buffer<u32>, u32)]) -> Result<f64> {
    let mut least = f64::MAX;
    for round in 0..=bench.rounds {
        let mut build = BuildEncoder::timed(&bench.gpu);
        sorter.sort(&mut build, words)?;
        let taken: f64 = build.times().iter().map(|time| time.milliseconds).sum();
        if round > 0 {
            least = least.min(taken);
        }
    }
    Ok(words[0].0.len() as f64 / (1e3 * least))
}
