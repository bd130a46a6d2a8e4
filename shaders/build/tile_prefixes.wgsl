// Prefix sums, last dispatch.
// Reads: values, sums of the tiles before each tile.
// Writes: the sum of the values before each value.
// use shared/build/digit
// use shared/build/scan

@group(0) @binding(2) var<storage, read> values: array<u32>;
@group(0) @binding(3) var<storage, read> counts: array<u32>;
@group(0) @binding(4) var<storage, read_write> prefixes: array<u32>;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = tile_of(id);
    let first = tile * TILE + id.local * KEYS_EACH;
    let end = min(min(digit.n_keys, slice.end * TILE), first + KEYS_EACH);
    var sum = 0u;
    for (var i = first; i < end; i++) {
        sum += values[i];
    }
    var before = scan_group(id.local, sum).before;
    if tile < slice.end {
        before += counts[tile];
    }
    for (var i = first; i < end; i++) {
        prefixes[i] = before;
        before += values[i];
    }
}
