// Sort, where there are several trees.
// Writes: the tree of each item, the most significant word of its key.
// use shared/build/slice
// use shared/build/forest

@group(0) @binding(1) var<storage, read_write> tree_indices: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let item = slice_item(group, groups, 64u, local);
    if item < slice.end {
        tree_indices[item] = tree_of(item);
    }
}
