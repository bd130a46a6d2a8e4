// Prefix sums, first dispatch; build/sort_scan is the second.
// Reads: values.
// Writes: the sum of each tile.
// use shared/build/digit
// use shared/build/scan

@group(0) @binding(2) var<storage, read> values: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = tile_of(id);
    let end = min(min(digit.n_keys, slice.end * TILE), (tile + 1u) * TILE);
    var sum = 0u;
    for (var i = tile * TILE + id.local; i < end; i += GROUP) {
        sum += values[i];
    }
    let scanned = scan_group(id.local, sum);
    if id.local == 0u && tile < slice.end {
        counts[tile] = scanned.total;
    }
}
