// Volumes, once before the levels.
// Reads: heights, nodes sorted by height.
// Writes: for each height, the number of nodes that are not higher.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> heights: array<u32>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read_write> ends: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = slice_item(group, groups, 64u, local);
    if i >= slice.end {
        return;
    }
    let height = heights[order[i]];
    // The last node of this height.
    if i + 1u == arrayLength(&heights) || heights[order[i + 1u]] != height {
        ends[height] = i + 1u;
    }
}
