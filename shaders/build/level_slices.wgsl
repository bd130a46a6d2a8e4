// Volumes, once before the levels, where the host does not wait for their sizes.
// Reads: for each height, the number of nodes that are not higher; zero for a height without nodes.
// Writes: for each height, the slice of its nodes, and the work-groups of a dispatch over it.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> ends: array<u32>;
/// A slice for each height, as far apart as every device lets uniforms be.
@group(0) @binding(2) var<storage, read_write> slices: array<u32>;
@group(0) @binding(3) var<storage, read_write> groups: array<u32>;

/// Words between slices.
const SLICE_WORDS: u32 = 64u;

/// Work-groups along one axis, at most.
const MOST_GROUPS: u32 = 65535u;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let height = slice_item(id, 64u);
    if height >= slice.end {
        return;
    }
    var first = 0u;
    for (var lower = 0u; lower < height; lower++) {
        first = max(first, ends[lower]);
    }
    let end = max(first, ends[height]);
    slices[SLICE_WORDS * height] = first;
    slices[SLICE_WORDS * height + 1u] = end;
    slices[SLICE_WORDS * height + 2u] = 0u;
    // In rows of equal length, as on the host.
    let n = (end - first + 63u) / 64u;
    let rows = max((n + MOST_GROUPS - 1u) / MOST_GROUPS, 1u);
    groups[3u * height] = (n + rows - 1u) / rows;
    groups[3u * height + 1u] = rows;
    groups[3u * height + 2u] = 1u;
}
