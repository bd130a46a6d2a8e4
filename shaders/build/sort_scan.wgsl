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
