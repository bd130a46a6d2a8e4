// Sort, first dispatch of a digit.
// Reads: keys.
// Writes: for each value of the digit, the number of keys in each tile.
// Source: least significant digit radix sort by reduce, scan and scatter. No work-group waits for another.
// use shared/build/digit

@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

var<workgroup> histogram: array<atomic<u32>, RADIX>;

@compute @workgroup_size(GROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let tile = tile_of(group, groups);
    let end = min(digit.n_keys, (tile + 1u) * TILE);
    for (var i = tile * TILE + local; i < end; i += GROUP) {
        atomicAdd(&histogram[digit_of(keys_in[i])], 1u);
    }
    workgroupBarrier();
    if local < RADIX && tile < slice.end {
        counts[local * digit.n_tiles + tile] = atomicLoad(&histogram[local]);
    }
}
