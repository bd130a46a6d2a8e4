//! The prefix sums of the sort alone, compared with a loop on the CPU.

use bytemuck::{Pod, Zeroable};
use canted_fixtures::SplitMix64;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, NamedBinding, Variant};

use crate::setup::gpu;

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(sums_match_the_cpu_at_every_length), needs_device(the_comparison_detects_one_wrong_sum)]
}

/// Rows of one dispatch, each summed by its own work-group.
const ROWS: u32 = 3;

/// As in `shared/build.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Digit {
    n_keys: u32,
    n_tiles: u32,
    shift: u32,
}

/// The exclusive prefix sums of each row, and the rows' totals; by work-groups of `group` invocations.
fn scanned(gpu: &Gpu, group: u32, rows: &[Vec<u32>]) -> (Vec<u32>, Vec<u32>) {
    let tiled = Variant::none().number("GROUP", group).number("KEYS_EACH", 16).number("RADIX", ROWS);
    let kernel = gpu.kernel("build/sort_scan", &tiled).unwrap();
    let n_tiles = u32::try_from(rows[0].len()).unwrap();
    let digit = gpu.uniform("digit", &Digit { n_keys: 0, n_tiles, shift: 0 }).unwrap();
    let counts = gpu.buffer("counts", &rows.concat()).unwrap();
    // The initial content must not matter.
    let totals = gpu.buffer("totals", &[7; ROWS as usize]).unwrap();
    let bound: [NamedBinding<'_>; 3] = [("digit", &digit), ("counts", &counts), ("totals", &totals)];
    let mut commands = gpu.commands();
    commands.dispatch(&kernel, &bound, [ROWS, 1, 1]).unwrap();
    commands.run().unwrap();
    (gpu.read(&counts).unwrap(), gpu.read(&totals).unwrap())
}

/// The same as a loop. Sums wrap around on both sides.
fn scanned_by_cpu(rows: &[Vec<u32>]) -> (Vec<u32>, Vec<u32>) {
    let (mut before, mut totals) = (vec![], vec![]);
    for row in rows {
        let mut sum = 0_u32;
        for &number in row {
            before.push(sum);
            sum = sum.wrapping_add(number);
        }
        totals.push(sum);
    }
    (before, totals)
}

fn rows(n: usize) -> Vec<Vec<u32>> {
    let mut rng = SplitMix64::new(n as u64);
    (0..ROWS).map(|row| (0..n).map(|_| u32::try_from(rng.below(1 << (10 * (row + 1)))).unwrap()).collect()).collect()
}

/// Up to the tiles of 67 million keys, but not a million numbers: llvmpipe ends a kernel's loops after some 65,535 iterations in
/// total, which corresponds to 600,000 numbers.
fn sums_match_the_cpu_at_every_length() {
    let gpu = gpu();
    for n in [0, 1, 2, 63, 64, 65, 255, 256, 257, 65_537] {
        let rows = rows(n);
        for group in [64, 256] {
            assert!(scanned(&gpu, group, &rows) == scanned_by_cpu(&rows), "{n} numbers, {group} invocations");
        }
    }
}

fn the_comparison_detects_one_wrong_sum() {
    let gpu = gpu();
    let rows = rows(1000);
    let mut other = rows.clone();
    other[1][999] ^= 1;
    let ((before, totals), (before_there, totals_there)) = (scanned(&gpu, 64, &other), scanned_by_cpu(&rows));
    // The last number affects only the total of its row.
    assert!(before == before_there && totals != totals_there);
    other[1][0] ^= 1;
    assert!(scanned(&gpu, 64, &other).0 != before_there);
}
