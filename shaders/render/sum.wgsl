// Sums of samples on the device, with the bits of those of the host: an f64 is computed in integers, and samples are added by halves.
//
// `?summed` is what is summed of each sample.
//
// ```text
// samples of a dispatch -> blocks: sums of 64 samples -> pixels: one sum for each block of samples so far -> sums, after the last sample
// ```
//
// As on the host, the sum over samples `[k * 2^j, (k + 1) * 2^j)` is the sum of its two halves, and the sum of all adds these from the longest on. So
// the bits depend neither on dispatches nor on tiles. Samples that no kernel finished are counted; then `pixels` adds nothing, until
// the host has taken those samples.
// use shared/invocation/index
// use shared/picture
// use ?summed

/// Samples of a block, and the level of its sum: the logarithm.
const BLOCK: u32 = 64u;
const BLOCK_LEVEL: u32 = 6u;

/// Samples of the dispatch that were not finished.
@group(1) @binding(6) var<storage, read_write> n_unfinished: atomic<u32>;
/// The sums of whole blocks, by pixel from the work-group of the first sample on.
@group(1) @binding(7) var<storage, read_write> blocks: array<SampleSum>;

// part blocks
// Sums the blocks of 64 samples that are whole in the dispatch, and counts samples that were not finished.

/// The samples of a pixel in a block.
var<workgroup> lanes: array<SampleSum, 64>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    if taken(group, id.local).is_inside && is_unfinished(64u * group + id.local) {
        atomicAdd(&n_unfinished, 1u);
    }
    // The work-groups of the samples of a block take one of its pixels each.
    let of_cell = (slice.first_group + group) % slice.n_samples;
    let pixel = of_cell % BLOCK;
    let first = group - pixel;
    let is_whole = pixel <= group && of_cell - pixel + BLOCK <= slice.n_samples
        && slice.first_group + first + BLOCK <= slice.end_group;
    let lane = id.local;
    var mine: SampleSum;
    if is_whole {
        let one = taken(first + lane, pixel);
        if one.is_inside {
            mine = sum_of(one, 64u * (first + lane) + pixel);
        }
    }
    lanes[lane] = mine;
    for (var half = 1u; half < BLOCK; half *= 2u) {
        workgroupBarrier();
        if lane % (2u * half) == 0u {
            lanes[lane] = plus(lanes[lane], lanes[lane + half]);
        }
    }
    if is_whole && lane == 0u {
        blocks[group] = lanes[0];
    }
}

// part pixels
// Adds the samples of a dispatch to those before, pixel by pixel.

/// The sums of blocks of 1, 2, 4 and more samples that wait for the other half of a longer block: for each size, one per pixel of the cells.
@group(1) @binding(8) var<storage, read_write> waiting: array<SampleSum>;
/// One per pixel of the cells, after its last sample.
@group(1) @binding(9) var<storage, read_write> sums: array<SampleSum>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let cell = group_index(id);
    if cell * slice.n_samples >= slice.end_group || atomicLoad(&n_unfinished) != 0u {
        return;
    }
    let before = cell * slice.n_samples;
    // Samples of the pixel that earlier dispatches took, and those after this one.
    var n = max(slice.first_group, before) - before;
    let end = min(slice.end_group - before, slice.n_samples);
    let n_places = arrayLength(&sums);
    let place = 64u * (slice.first_cell + cell) + id.local;
    while n < end {
        let group = before + n - slice.first_group;
        let is_block = n % BLOCK == 0u && n + BLOCK <= end;
        var sum: SampleSum;
        var level = 0u;
        if is_block {
            sum = blocks[group + id.local];
            level = BLOCK_LEVEL;
        } else {
            sum = sum_of(taken(group, id.local), 64u * group + id.local);
        }
        while ((n >> level) & 1u) == 1u {
            sum = plus(waiting[level * n_places + place], sum);
            level += 1u;
        }
        waiting[level * n_places + place] = sum;
        n += select(1u, BLOCK, is_block);
    }
    if n == slice.n_samples {
        var level = firstLeadingBit(n);
        var sum = waiting[level * n_places + place];
        while level > 0u {
            level -= 1u;
            if ((n >> level) & 1u) == 1u {
                sum = plus(sum, waiting[level * n_places + place]);
            }
        }
        sums[place] = sum;
    }
}
