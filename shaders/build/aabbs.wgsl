// Volumes: axis-aligned boxes, bottom-up.
// Reads: parents, leaves.
// Writes: the box of each inner node. Its coordinates are copies of coordinates of the items.
// use shared/build/slice
// use shared/build/climb
// use ?item

@group(0) @binding(2) var<storage, read> leaves: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let leaf = slice_item(group, groups, 64u, local);
    if leaf < slice.end {
        climb(parent_of_leaf(leaf), item_reach(leaves[leaf]));
    }
}
