// Radix sort of keys with values, prefix sums over tiles, and what orders items by the result.

// part count
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

// part scan
// Sort, second dispatch of a digit: one work-group for each value of the digit.
// Reads: counts of the tiles.
// Writes: exclusive prefix sums of the counts, in place, and the total for the value.
// use shared/build/digit
// use shared/build/scan

@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let row = group.x * digit.n_tiles;
    var sum = 0u;
    for (var first = 0u; first < digit.n_tiles; first += GROUP) {
        let tile = first + local;
        var count = 0u;
        if tile < digit.n_tiles {
            count = counts[row + tile];
        }
        let scanned = scan_group(local, count);
        if tile < digit.n_tiles {
            counts[row + tile] = sum + scanned.before;
        }
        sum += scanned.total;
    }
    if local == 0u {
        totals[group.x] = sum;
    }
}

// part scatter
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

// part tile_sums
// Prefix sums, first dispatch; build/sort/scan is the second.
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

// part tile_prefixes
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

// part item_indices
// Sort, before the first digit.
// Writes: the item indices in input order.
// use shared/build/slice

@group(0) @binding(1) var<storage, read_write> items: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i < slice.end {
        items[i] = i;
    }
}

// part gather
// Sort, between two words of the key.
// Reads: words by item, items in order.
// Writes: the word of each item, in that order.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<u32>;
@group(0) @binding(3) var<storage, read_write> gathered: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i < slice.end {
        gathered[i] = words[items[i]];
    }
}
