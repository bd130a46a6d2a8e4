// Radix sort of keys with values, prefix sums over tiles, and what orders items by the result.

// part count
// Sort, before the first digit, where what makes the keys does not count them.
// Reads: keys.
// Writes: for each value of the digit, the number of keys in each block of tiles and in each tile.
// Source: least significant digit radix sort by reduce, scan and scatter. No work-group waits for another.
// use shared/build/digit/counts

@group(0) @binding(2) var<storage, read> words: array<u32>;

var<workgroup> histogram: array<atomic<u32>, RADIX>;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = tile_of(id);
    let end = min(digit.n_keys, (tile + 1u) * TILE);
    for (var i = tile * TILE + id.local; i < end; i += GROUP) {
        atomicAdd(&histogram[digit_of(words[i])], 1u);
    }
    workgroupBarrier();
    if tile < slice.end {
        for (var value = id.local; value < RADIX; value += GROUP) {
            add_keys(digit.first_count, value, tile, atomicLoad(&histogram[value]));
        }
    }
}

// choice keys/first
// Before the first digit: the first word of the keys, of items in input order.

@group(0) @binding(2) var<storage, read> words: array<u32>;

fn key_at(i: u32) -> u32 {
    return words[i];
}

fn item_at(i: u32) -> u32 {
    return i;
}

// choice keys/gathered
// Before the first digit of a further word: the word of each item, in the order so far.

@group(0) @binding(2) var<storage, read> words: array<u32>;
@group(0) @binding(4) var<storage, read> values_in: array<u32>;

fn key_at(i: u32) -> u32 {
    return words[values_in[i]];
}

fn item_at(i: u32) -> u32 {
    return values_in[i];
}

// choice keys/moved
// Between the digits of a word: what the last digit wrote.

@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(4) var<storage, read> values_in: array<u32>;

fn key_at(i: u32) -> u32 {
    return keys_in[i];
}

fn item_at(i: u32) -> u32 {
    return values_in[i];
}

// part in_tile
// Sorts the keys of a tile in work-group memory, four bits at a time.
//
// An invocation owns consecutive places and a column of counters, one for each value of four bits. The prefix sum over columns gives the rank of each key, so the
// sort is stable. Source: Satish, Harris and Garland 2009.
// use shared/build/digit
// use shared/build/scan

const NIBBLE: u32 = 16u;

var<workgroup> columns: array<u32, NIBBLE * GROUP>;

/// What is sorted, in the order so far and in the next: keys of few bits above the place in the tile.
var<workgroup> entries: array<u32, 2u * TILE>;

/// Bits of a place in the tile.
const PLACE_BITS: u32 = 16u;

fn place_of(entry: u32) -> u32 {
    return entry & 0xffffu;
}

/// Replaces each counter by the sum of the counters before it, ordered by value, then by invocation.
fn rank(local: u32) {
    var sum = 0u;
    for (var c = 0u; c < NIBBLE; c++) {
        sum += columns[local * NIBBLE + c];
    }
    var before = scan_group(local, sum).before;
    for (var c = 0u; c < NIBBLE; c++) {
        let cell = local * NIBBLE + c;
        let count = columns[cell];
        columns[cell] = before;
        before += count;
    }
}

// part scatter
// Sort, the dispatch of a digit.
// Reads: keys with items, counts of the digit.
// Writes: keys with items, sorted by the digit, and the counts of the next digit. A tile is sorted first, so that it writes runs.
// use build/sort/in_tile
// use shared/build/digit/counts
// use ?keys

@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;
/// The next word of the keys, by item.
@group(0) @binding(8) var<storage, read> next_words: array<u32>;

/// Destination of the keys of each value, minus their first place in the sorted tile; may wrap around.
var<workgroup> destinations: array<u32, RADIX>;

/// First place of each value in the sorted tile.
var<workgroup> starts: array<u32, RADIX>;

/// Keys of each value before this tile, and in all tiles.
fn before_and_all(value: u32, tile: u32) -> vec2<u32> {
    let row = row_of(digit.first_count, value);
    var sums = vec2<u32>(0u);
    if digit.n_blocks == 0u {
        for (var other = 0u; other < digit.n_tiles; other += 1u) {
            let count = atomicLoad(&counts[row + other]);
            sums += vec2<u32>(select(0u, count, other < tile), count);
        }
        return sums;
    }
    let own = tile / BLOCK;
    for (var block = 0u; block < digit.n_blocks; block += 1u) {
        let count = atomicLoad(&counts[row + block]);
        sums += vec2<u32>(select(0u, count, block < own), count);
    }
    for (var other = own * BLOCK; other < tile; other += 1u) {
        sums.x += atomicLoad(&counts[row + digit.n_blocks + other]);
    }
    return sums;
}

/// Counts a key that moves to `destination` for the next digit.
fn count_next(key: u32, item: u32, destination: u32) {
    if digit.next == 0u {
        return;
    }
    var value = ((key / RADIX) >> digit.shift) & (RADIX - 1u);
    if digit.next == NEXT_WORD {
        value = next_words[item] & (RADIX - 1u);
    }
    add_keys(row_of(digit.first_count, RADIX), value, destination / TILE, 1u);
}

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = tile_of(id);
    let start = tile * TILE;
    let n = min(digit.n_keys, slice.end * TILE) - min(start, min(digit.n_keys, slice.end * TILE));
    let n_in_tile = min(n, TILE);
    for (var place = id.local; place < n_in_tile; place += GROUP) {
        entries[place] = (digit_of(key_at(start + place)) << PLACE_BITS) | place;
    }
    // Two rounds of four bits, from one half of the memory to the other and back.
    for (var round = 0u; round < 2u; round += 1u) {
        let from_half = round * TILE;
        let to_half = TILE - from_half;
        let shift = PLACE_BITS + 4u * round;
        for (var c = 0u; c < NIBBLE; c += 1u) {
            columns[c * GROUP + id.local] = 0u;
        }
        workgroupBarrier();
        let first = id.local * KEYS_EACH;
        let end = min(n_in_tile, first + KEYS_EACH);
        for (var place = first; place < end; place += 1u) {
            columns[((entries[from_half + place] >> shift) & 15u) * GROUP + id.local] += 1u;
        }
        workgroupBarrier();
        rank(id.local);
        workgroupBarrier();
        for (var place = first; place < end; place += 1u) {
            let entry = entries[from_half + place];
            let cell = ((entry >> shift) & 15u) * GROUP + id.local;
            entries[to_half + columns[cell]] = entry;
            columns[cell] += 1u;
        }
        workgroupBarrier();
    }
    for (var place = id.local; place < n_in_tile; place += GROUP) {
        let value = entries[place] >> PLACE_BITS;
        if place == 0u || value != entries[place - 1u] >> PLACE_BITS {
            starts[value] = place;
        }
    }
    workgroupBarrier();
    // Consecutive values for each invocation, so that one scan over the invocations sums those before.
    const VALUES_EACH: u32 = RADIX / GROUP;
    var sums: array<vec2<u32>, VALUES_EACH>;
    var all = 0u;
    for (var k = 0u; k < VALUES_EACH; k += 1u) {
        sums[k] = before_and_all(id.local * VALUES_EACH + k, min(tile, max(digit.n_tiles, 1u) - 1u));
        all += sums[k].y;
    }
    var before = scan_group(id.local, all).before;
    for (var k = 0u; k < VALUES_EACH; k += 1u) {
        let value = id.local * VALUES_EACH + k;
        destinations[value] = before + sums[k].x - starts[value];
        before += sums[k].y;
    }
    workgroupBarrier();
    for (var place = id.local; place < n_in_tile; place += GROUP) {
        let entry = entries[place];
        let destination = destinations[entry >> PLACE_BITS] + place;
        let key = key_at(start + place_of(entry));
        let item = item_at(start + place_of(entry));
        keys_out[destination] = key;
        values_out[destination] = item;
        count_next(key, item, destination);
    }
}

// part small
// Sort of the keys of one tile by all bits of a word: one work-group, one dispatch.
// Reads: keys with items.
// Writes: items, sorted; after the last word, that word of each.
// use build/sort/in_tile
// use ?keys

@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    for (var place = id.local; place < digit.n_keys; place += GROUP) {
        entries[place] = place;
    }
    // `digit.shift` is the number of bits.
    var half = 0u;
    for (var shift = 0u; shift < digit.shift; shift += 4u) {
        for (var c = 0u; c < NIBBLE; c += 1u) {
            columns[c * GROUP + id.local] = 0u;
        }
        workgroupBarrier();
        let first = id.local * KEYS_EACH;
        let end = min(digit.n_keys, first + KEYS_EACH);
        for (var place = first; place < end; place += 1u) {
            columns[((key_at(entries[half + place]) >> shift) & 15u) * GROUP + id.local] += 1u;
        }
        workgroupBarrier();
        rank(id.local);
        workgroupBarrier();
        for (var place = first; place < end; place += 1u) {
            let entry = entries[half + place];
            let cell = ((key_at(entry) >> shift) & 15u) * GROUP + id.local;
            entries[TILE - half + columns[cell]] = entry;
            columns[cell] += 1u;
        }
        half = TILE - half;
        workgroupBarrier();
    }
    for (var place = id.local; place < digit.n_keys; place += GROUP) {
        values_out[place] = item_at(entries[half + place]);
        if digit.next == 0u {
            keys_out[place] = key_at(entries[half + place]);
        }
    }
}

// part tile_sums
// Prefix sums, first dispatch, where there are several tiles.
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
// Reads: values, sums of the tiles.
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
    var before_tile = 0u;
    for (var other = id.local; other < min(tile, slice.end); other += GROUP) {
        before_tile += counts[other];
    }
    var before = scan_group(id.local, sum).before + scan_group(id.local, before_tile).total;
    for (var i = first; i < end; i++) {
        prefixes[i] = before;
        before += values[i];
    }
}

// part gather_two
// After a sort by two words.
// Reads: words by item, items in order.
// Writes: the words of each item, in that order.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<u32>;
@group(0) @binding(3) var<storage, read_write> gathered: array<u32>;
@group(0) @binding(4) var<storage, read> high_words: array<u32>;
@group(0) @binding(5) var<storage, read_write> high_gathered: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i < slice.end {
        gathered[i] = words[items[i]];
        high_gathered[i] = high_words[items[i]];
    }
}

// part gather
// After a sort.
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
