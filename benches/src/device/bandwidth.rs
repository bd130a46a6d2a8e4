//! Memory bandwidth and transfers of the device, and the times that bandwidth allows.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_gpu::{AdapterKind, Gpu, NamedBinding, Variant};
use canted_lbvh::Strategy;

use super::Bench;

/// Copied by the kernel, in units of sixteen bytes. Caches of devices hold less; a software driver is not kept busy for long.
const QUADS: [usize; 2] = [1 << 20, 1 << 22];

/// Transferred sizes in MiB.
const TRANSFERS: [usize; 3] = [1, 8, 64];

/// Bytes per second that a kernel reads and writes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bandwidth(f64);

impl Bandwidth {
    /// Measured by a kernel that copies a buffer.
    pub(super) fn measure(gpu: &Gpu, rounds: usize) -> Result<Self> {
        let n = QUADS[usize::from(gpu.info().kind != AdapterKind::Software)];
        let from = gpu.zeroed::<[u32; 4]>("copied", n)?;
        let to = gpu.zeroed::<[u32; 4]>("copy", n)?;
        let kernel = gpu.kernel("check/copy", &Variant::none())?;
        let bound: [NamedBinding<'_>; 2] = [("copied_from", &from), ("copied_to", &to)];
        let mut least = f64::MAX;
        for round in 0..=rounds {
            let mut commands = gpu.timed_commands();
            commands.dispatch(&kernel, &bound, kernel.groups(u32::try_from(n)?))?;
            gpu.finish()?;
            let start = Instant::now();
            let passes = commands.times()?;
            let wall = start.elapsed().as_secs_f64();
            let seconds = passes.first().map_or(wall, |pass| pass.milliseconds * 1e-3);
            if round > 0 {
                least = least.min(seconds);
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
        let n_bytes = (n * 2 * size_of::<[u32; 4]>()) as f64;
        Ok(Self(n_bytes / least))
    }

    /// Milliseconds in which a pass moves so many bytes for each of `n` items, if nothing else limits it.
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    pub(super) fn milliseconds(self, bytes_each: f64, n: usize) -> f64 {
        1e3 * bytes_each * n as f64 / self.0
    }

    /// Million items per second.
    pub(super) fn rate(self, bytes_each: f64) -> f64 {
        1e-6 * self.0 / bytes_each
    }

    fn giga_bytes(self) -> f64 {
        1e-9 * self.0
    }
}

/// Bytes that each pass of a build must move for a triangle, beyond all caches: what its kernels read and write, once.
///
/// A leaf has one inner node beside it, so a node counts as a triangle. Corners are 36 bytes, nodes 16, axis-aligned boxes 24, oriented
/// ones 60, codes two words, links and indices one.
pub(super) mod bytes {
    use super::Strategy;

    pub(in super::super) const DOMAIN: f64 = 36.0;
    pub(in super::super) const CODES: f64 = 36.0 + 8.0;
    /// Sixteen digits of four bits: keys to count, pairs to read and to write; before each word, and for the sorted codes, a gather of index,
    /// key and copy.
    pub(in super::super) const SORT: f64 = 16.0 * (4.0 + 8.0 + 8.0) + 4.0 * 12.0 + 4.0;
    /// The codes; nodes and two links; then a link of each leaf, and of each node an exchange by either child and a link upwards.
    pub(in super::super) const NODES: f64 = 8.0 + 16.0 + 8.0 + 4.0 + 2.0 * 8.0 + 4.0;
    /// Corners through an index, links; six exchanges by either child, each a read and a write.
    pub(in super::super) const AABB: f64 = 36.0 + 4.0 + 8.0 + 2.0 * 6.0 * 8.0;
    /// The volumes of both children of a node (one is a leaf on average), the node and its own box in both forms.
    const MERGE: f64 = 4.0 + 16.0 + (36.0 + 4.0) + 60.0 + 24.0 + 60.0;
    /// Seven passes over nodes by height, two words each way.
    const LEVELS: f64 = 2.0 * 20.0 + 12.0 + 8.0;
    /// Volumes of both children, node, and traversed form.
    pub(in super::super) const ALIGNED_PAIRS: f64 = 16.0 + 24.0 + 40.0 + 64.0;

    /// The boxes of a strategy, without the axis-aligned ones.
    pub(in super::super) fn boxes(strategy: Strategy) -> f64 {
        match strategy {
            Strategy::Aabb => AABB,
            Strategy::PcaBounded | Strategy::Quaternion | Strategy::Combined => LEVELS + MERGE,
            // Moments as merges; then corners again, and extents by exchange, of at least one node above each leaf.
            Strategy::PcaUnbounded => LEVELS + MERGE + 40.0 + 96.0 + 100.0 + 60.0,
            // Fifteen frames: corners, extents by exchange, and boxes kept or replaced.
            Strategy::Dop => 84.0 + 15.0 * (40.0 + 96.0 + 24.0 + 2.0 * 60.0),
        }
    }
}

/// Measures bandwidth and transfers and writes the section.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    let gpu = &bench.gpu;
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Memory and transfers\n\nA kernel that copies a buffer moves {:.1} GB/s, reads and writes counted. Expected times below are \
         the bytes that a pass must move, once, divided by this: a pass far above is bound by something else, such as latency, \
         arithmetic or too few work-groups; one below works in caches. Transfers are minimum wall times of {} rounds, with allocation \
         and waiting.\n\n| MiB | upload, ms | GB/s | download, ms | GB/s |\n| --- | --- | --- | --- | --- |",
        bench.bandwidth.giga_bytes(),
        bench.rounds
    );
    for mib in TRANSFERS {
        let words = vec![1u32; mib << 18];
        let upload = least(bench.rounds, || {
            let buffer = gpu.buffer("uploaded", &words)?;
            gpu.finish()?;
            drop(buffer);
            Ok(())
        })?;
        let buffer = gpu.buffer("downloaded", &words)?;
        gpu.finish()?;
        let download = least(bench.rounds, || {
            std::hint::black_box(gpu.read(&buffer)?);
            Ok(())
        })?;
        #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
        let giga_bytes = (mib << 20) as f64 * 1e-9;
        let rate = |milliseconds: f64| 1e3 * giga_bytes / milliseconds;
        let _ = writeln!(out, "| {mib} | {upload:.2} | {:.2} | {download:.2} | {:.2} |", rate(upload), rate(download));
    }
    Ok(())
}

/// The minimum wall time in milliseconds of several runs after a warm-up.
pub(super) fn least(rounds: usize, mut work: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut once = || -> Result<f64> {
        let start = Instant::now();
        work()?;
        Ok(start.elapsed().as_secs_f64() * 1e3)
    };
    once()?;
    (0..rounds).try_fold(f64::MAX, |least, _| Ok(least.min(once()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expected_times_follow_from_bytes() {
        let bandwidth = Bandwidth(1e9);
        assert_eq!(bandwidth.milliseconds(100.0, 10_000), 1.0);
        assert_eq!(bandwidth.rate(500.0), 2.0);
    }
}
