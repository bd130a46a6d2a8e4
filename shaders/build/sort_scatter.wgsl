// Sort, last dispatch of a digit.
// Reads: keys with values, prefix sums of the counts.
// Writes: keys with values, sorted by the digit.
// Holds: the sort is stable. An invocation owns consecutive keys and a column of counters, one for each value of the digit; the
// prefix sum over columns gives the rank of each key in its tile.
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
/// Destination of the keys of each value, minus their first rank in the tile; may wrap around.
var<workgroup> destinations: array<u32, RADIX>;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = tile_of(id);
    let first = tile * TILE + id.local * KEYS_EACH;
    let end = min(min(digit.n_keys, slice.end * TILE), first + KEYS_EACH);
    for (var i = first; i < end; i++) {
        columns[digit_of(keys_in[i]) * GROUP + id.local] += 1u;
    }
    workgroupBarrier();
    rank(id.local);
    workgroupBarrier();
    if id.local < RADIX && tile < slice.end {
        var before = 0u;
        for (var value = 0u; value < id.local; value++) {
            before += totals[value];
        }
        destinations[id.local] = before + counts[id.local * digit.n_tiles + tile] - columns[id.local * GROUP];
    }
    workgroupBarrier();
    for (var i = first; i < end; i++) {
        let key = keys_in[i];
        let value = digit_of(key);
        let cell = value * GROUP + id.local;
        let destination = destinations[value] + columns[cell];
        columns[cell] += 1u;
        keys_out[destination] = key;
        values_out[destination] = values_in[i];
    }
}

/// Replaces each counter by the sum of the counters before it, ordered by value of the digit, then by invocation.
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
