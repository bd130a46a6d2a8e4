// Sort, before the first digit.
// Writes: the items in input order.
// use shared/build/slice

@group(0) @binding(1) var<storage, read_write> items: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = slice_item(group, groups, 64u, local);
    if i < slice.end {
        items[i] = i;
    }
}
