// Volumes, `dop`, before the first frame: converts axis-aligned boxes.
// Reads: axis-aligned boxes.
// Writes: the same boxes as center, identity frame and half-extents.
// use shared/build/slice
// use shared/volumes/boxes

@group(0) @binding(1) var<storage, read> aabbs: array<f32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let at = 6u * slot;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    put_box(slot, box_from_aabb(low, high));
}
