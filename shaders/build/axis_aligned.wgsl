// Volumes, `dop`, before the first frame: boxes along the axes of the space.
// Reads: axis-aligned boxes. Writes: the same with midpoints and half-extents.
// use shared/build/slice
// use shared/build/boxes

@group(0) @binding(1) var<storage, read> aabbs: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let slot = slice_item(group, groups, 64u, local);
    if slot >= slice.end {
        return;
    }
    let at = 6u * slot;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    put_box(slot, box_from_aabb(low, high));
}
