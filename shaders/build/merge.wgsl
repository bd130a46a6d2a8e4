// Volumes: oriented boxes, one dispatch per height.
// Reads: boxes of the children, axis-aligned boxes.
// Writes: one box per node; the axis-aligned one if the oriented box does not have less area.
// Holds: a box contains the boxes of its children and its items exactly; see shared/volumes/enclosure.
// use shared/build/slice
// use shared/build/tree
// use shared/volumes/boxes
// use ?item
// use ?rule

@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> nodes: array<Node>;
@group(0) @binding(3) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read> aabbs: array<f32>;

fn child_content(child: u32) -> Content {
    if (child & LEAF) != 0u {
        return item_content(leaves[child & ~LEAF]);
    }
    let columns = mat3x3<f32>(part(child, 1u), part(child, 2u), part(child, 3u));
    return Content(true, part(child, 0u), columns, part(child, 4u));
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= slice.end {
        return;
    }
    let slot = order[i];
    let a = child_content(nodes[slot].left);
    let b = child_content(nodes[slot].right);
    let at = 6u * slot;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    var volume = box_from_aabb(low, high);
    let oriented = enclosed(frame_of(a, b), a, b);
    // A rejected box has negative half-extents, which can multiply to a positive area.
    if all(oriented.half_extents >= vec3(0.0)) && half_area(oriented.half_extents) < half_area(0.5 * (high - low)) {
        volume = oriented;
    }
    put_box(slot, volume);
}
