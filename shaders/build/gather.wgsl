// Sort, between two words of the key.
// Reads: words by item, items in order.
// Writes: the word of each item, in that order.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<u32>;
@group(0) @binding(3) var<storage, read_write> gathered: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = slice_item(group, groups, 64u, local);
    if i < slice.end {
        gathered[i] = words[items[i]];
    }
}
