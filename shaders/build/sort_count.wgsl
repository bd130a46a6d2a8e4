// Sort, first dispatch of a digit.
// Reads: keys.
// Writes: for each value of the digit, the number of keys in each tile.
// Source: least significant digit radix sort by reduce, scan and scatter. No work-group waits for another.
// use shared/build/digit

@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

var<workgroup> histogram: array<atomic<u32>, RADIX>;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = tile_of(id);
    let end = min(digit.n_keys, (tile + 1u) * TILE);
    for (var i = tile * TILE + id.local; i < end; i += GROUP) {
        atomicAdd(&histogram[digit_of(keys_in[i])], 1u);
    }
    workgroupBarrier();
    if id.local < RADIX && tile < slice.end {
        counts[id.local * digit.n_tiles + tile] = atomicLoad(&histogram[id.local]);
    }
}
