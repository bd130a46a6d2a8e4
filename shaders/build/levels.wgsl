// Volumes, once before the levels.
// Reads: heights, nodes sorted by height.
// Writes: for each height, the number of nodes that are not higher.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> heights: array<u32>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read_write> ends: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= slice.end {
        return;
    }
    let height = heights[order[i]];
    // The last node of this height.
    if i + 1u == arrayLength(&heights) || heights[order[i + 1u]] != height {
        ends[height] = i + 1u;
    }
}
