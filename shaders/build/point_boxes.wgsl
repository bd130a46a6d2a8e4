// Volumes, `pca-unbounded`, third dispatch: the box of each node, or the axis-aligned one if that has no more area.
// Reads: extents, axis-aligned boxes, nodes, leaves; frames and points in the boxes.
// Writes: boxes.
// Holds: a box contains the items below it exactly; see shared/volumes/enclosure.
// use shared/build/slice
// use shared/build/ordered
// use shared/volumes/boxes
// use shared/volumes/dop

@group(0) @binding(3) var<storage, read> ends: array<u32>;
@group(0) @binding(6) var<storage, read> aabbs: array<f32>;

fn end_three(at: u32, first: u32) -> vec3<f32> {
    let words = vec3<u32>(end_of(ends[at], first), end_of(ends[at + 1u], first), end_of(ends[at + 2u], first));
    return bitcast<vec3<f32>>(words);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let node = nodes[slot];
    if node.last == node.first {
        return;
    }
    let at = 6u * slot;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    let origin = part(slot, 0u);
    let frame = mat3x3<f32>(part(slot, 1u), part(slot, 2u), part(slot, 3u));
    var extent = Extent();
    if is_small(node) {
        extent = extent_of_leaves(frame, origin, node.first, node.last);
    } else {
        // No item reaches farther from the point than the axis-aligned box; four roundings cover the difference and the sum.
        let reach = max(abs(low - origin), abs(high - origin));
        extent = Extent(end_three(at, 0u), end_three(at + 3u, 3u), length_1(reach) * (1.0 + 4.0 * ROUNDING));
    }
    let oriented = box_around(frame, origin, extent, skewness(frame) + 13.0 * ROUNDING);
    var volume = box_from_aabb(low, high);
    // A rejected box has negative half-extents, which can multiply to a positive area.
    if all(oriented.half_extents >= vec3(0.0)) && half_area(oriented.half_extents) < half_area(0.5 * (high - low)) {
        volume = oriented;
    }
    put_box(slot, volume);
}
