// Sort, last dispatch of a digit.
// Reads: keys with values, sums of counts. Writes: keys with values in the order of the digit.
// Holds: keys of equal digits keep their order. An invocation owns consecutive keys and a column of counters, one for each
// value of the digit; the sum over columns ranks each key in its tile.
// Source: Satish, Harris and Garland 2009.
// use shared/build/digit
// use shared/build/scan

@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<u32>;
@group(0) @binding(4) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(5) var<storage, read_write> values_out: array<u32>;
@group(0) @binding(6) var<storage, read> counts: array<u32>;
@group(0) @binding(7) var<storage, read> totals: array<u32>;

var<workgroup> columns: array<u32, RADIX * GROUP>;
/// Where the keys of each value go, less their first rank in the tile; wraps around.
var<workgroup> destinations: array<u32, RADIX>;

@compute @workgroup_size(GROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let tile = tile_of(group, groups);
    let first = tile * TILE + local * KEYS_EACH;
    let end = min(min(digit.n_keys, slice.end * TILE), first + KEYS_EACH);
    for (var i = first; i < end; i++) {
        columns[digit_of(keys_in[i]) * GROUP + local] += 1u;
    }
    workgroupBarrier();
    rank(local);
    workgroupBarrier();
    if local < RADIX && tile < slice.end {
        var before = 0u;
        for (var value = 0u; value < local; value++) {
            before += totals[value];
        }
        destinations[local] = before + counts[local * digit.n_tiles + tile] - columns[local * GROUP];
    }
    workgroupBarrier();
    for (var i = first; i < end; i++) {
        let key = keys_in[i];
        let value = digit_of(key);
        let cell = value * GROUP + local;
        let place = destinations[value] + columns[cell];
        columns[cell] += 1u;
        keys_out[place] = key;
        values_out[place] = values_in[i];
    }
}

/// Puts over each counter the sum of those before it, by value of the digit and then by invocation.
fn rank(local: u32) {
    var sum = 0u;
    for (var c = 0u; c < RADIX; c++) {
        sum += columns[local * RADIX + c];
    }
    var before = scan_group(local, sum).before;
    for (var c = 0u; c < RADIX; c++) {
        let cell = local * RADIX + c;
        let count = columns[cell];
        columns[cell] = before;
        before += count;
    }
}
