//! The sums behind the sort by themselves, beside a loop of the CPU.

use bytemuck::{Pod, Zeroable};
use canted_fixtures::SplitMix64;
use canted_gpu::{Gpu, NamedBinding, Specialisation};

use crate::setup::gpu;

/// Rows of one dispatch, each summed by a work-group of its own.
const ROWS: u32 = 3;

/// As in `shared/build/digit.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Digit {
    n_keys: u32,
    n_tiles: u32,
    shift: u32,
}

/// Over each number of a row the sum of those before it, and the sums of the rows; by work-groups of `group` invocations.
fn scanned(gpu: &Gpu, group: u32, rows: &[Vec<u32>]) -> (Vec<u32>, Vec<u32>) {
    let tiled = Specialisation::none().number("GROUP", group).number("KEYS_EACH", 16).number("RADIX", ROWS);
    let kernel = gpu.kernel("build/sort_scan", &tiled).unwrap();
    let n_tiles = u32::try_from(rows[0].len()).unwrap();
    let digit = gpu.uniform("digit", &Digit { n_keys: 0, n_tiles, shift: 0 }).unwrap();
    let counts = gpu.buffer("counts", &rows.concat()).unwrap();
    // What is there before must not count.
    let totals = gpu.buffer("totals", &[7; ROWS as usize]).unwrap();
    let bound: [NamedBinding<'_>; 3] = [("digit", &digit), ("counts", &counts), ("totals", &totals)];
    let mut commands = gpu.commands();
    commands.dispatch(&kernel, &bound, [ROWS, 1, 1]).unwrap();
    commands.run().unwrap();
    (gpu.read(&counts).unwrap(), gpu.read(&totals).unwrap())
}

/// The same by a loop. Sums wrap around on both sides.
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

/// Up to the tiles of 67 million keys. Not a million numbers: llvmpipe leaves a kernel's loops after some 65,535 turns of all of
/// them together, which is where 600,000 numbers end.
#[test]
fn sums_are_the_cpus_at_every_length() {
    let Some(gpu) = gpu("sums_are_the_cpus_at_every_length") else { return };
    for n in [0, 1, 2, 63, 64, 65, 255, 256, 257, 65_537] {
        let rows = rows(n);
        for group in [64, 256] {
            assert!(scanned(&gpu, group, &rows) == scanned_by_cpu(&rows), "{n} numbers, {group} invocations");
        }
    }
}

#[test]
fn the_comparison_sees_one_wrong_sum() {
    let Some(gpu) = gpu("the_comparison_sees_one_wrong_sum") else { return };
    let rows = rows(1000);
    let mut other = rows.clone();
    other[1][999] ^= 1;
    let ((before, totals), (before_there, totals_there)) = (scanned(&gpu, 64, &other), scanned_by_cpu(&rows));
    // Nothing stands behind the last number but the sum of its row.
    assert!(before == before_there && totals != totals_there);
    other[1][0] ^= 1;
    assert!(scanned(&gpu, 64, &other).0 != before_there);
}
