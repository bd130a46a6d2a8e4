//! Prefix sums.

use super::run::Dispatches;
use super::sort::{Digit, GROUP, KEYS_EACH, tiled};
use crate::{Buffer, GpuError, NamedBinding};

/// Writes the sum of the values before each of a range of values, counted from the start of its first tile.
pub(super) fn prefix_sums(
    dispatches: &mut Dispatches<'_>,
    values: &Buffer<u32>,
    prefixes: &Buffer<u32>,
    [first, end]: [u32; 2],
) -> Result<(), GpuError> {
    let gpu = dispatches.gpu;
    let n_tiles = end.div_ceil(GROUP * KEYS_EACH);
    let tiles = [first / (GROUP * KEYS_EACH), n_tiles];
    let counts = gpu.zeroed::<u32>("sums of tiles", n_tiles as usize)?;
    let totals = gpu.zeroed::<u32>("sum", 1)?;
    let digit = gpu.uniform("digit", &Digit { n_keys: end, n_tiles, shift: 0 })?;
    let bound: [NamedBinding<'_>; 5] =
        [("digit", &digit), ("values", values), ("counts", &counts), ("totals", &totals), ("prefixes", prefixes)];
    dispatches.tiles(&*gpu.kernel("build/tile_sums", &tiled())?, &bound, tiles)?;
    if n_tiles > 0 {
        // One row of sums.
        dispatches.work.dispatch(&*gpu.kernel("build/sort_scan", &tiled())?, &bound, [1, 1, 1])?;
    }
    dispatches.tiles(&*gpu.kernel("build/tile_prefixes", &tiled())?, &bound, tiles)
}
