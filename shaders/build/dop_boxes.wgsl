// Volumes, `dop`, second dispatch of a frame: the box along this frame replaces the node's box if it has less area.
// Reads: extents along the frame, axis-aligned boxes, nodes, leaves.
// Writes: boxes.
// Holds: a box contains the items below it exactly; see shared/volumes/enclosure.
// use shared/build/slice
// use shared/volumes/boxes
// use shared/volumes/dop

@group(0) @binding(3) var<storage, read> ends: array<f32>;
@group(0) @binding(6) var<storage, read> aabbs: array<f32>;

fn three(at: u32, is_end: bool) -> vec3<f32> {
    if is_end {
        return vec3<f32>(ends[at], ends[at + 1u], ends[at + 2u]);
    }
    return vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
}

/// The box along the frame from the extents computed bottom-up. No item reaches farther from the origin than its axis-aligned
/// box; three roundings cover the sum.
fn box_of_large_node(slot: u32) -> Box {
    let reach = max(abs(three(6u * slot, false)), abs(three(6u * slot + 3u, false)));
    let size = length_1(reach) * (1.0 + 3.0 * ROUNDING);
    let extent = Extent(three(6u * slot, true), three(6u * slot + 3u, true), size);
    return box_around(fixed_frame.frame, vec3(0.0), extent, fixed_frame.skewness);
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
    var volume = Box();
    if is_small(node) {
        let origin = item_content(leaves[node.first]).center;
        let extent = extent_of_leaves(fixed_frame.frame, origin, node.first, node.last);
        volume = box_around(fixed_frame.frame, origin, extent, fixed_frame.skewness);
    } else {
        volume = box_of_large_node(slot);
    }
    if half_area(volume.half_extents) < half_area(part(slot, 4u)) {
        put_box(slot, volume);
    }
}
