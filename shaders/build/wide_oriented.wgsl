// Wide nodes with a frame for each child, in the layout of shared/bvh, `node_kinds`.
//
// # Half-extents
// A slab as in shared/build/pair/obb holds all points of the box, about the box's center. The node stores the
// coordinate of the center along the axis, a dot product that errs by 3 E of its absolute terms, less than 4 E as computed; the
// half-extent grows by as much.
// Reads: binary tree, oriented boxes, triangles, the order of wide nodes and their children.
// Writes: one node for each that is oriented.
// use shared/build/wide_target
// use shared/volumes/frame
// use shared/volumes/slab
// use shared/volumes/item/triangles

/// Fifteen floats per inner node: center, three axes, half-extents.
@group(0) @binding(9) var<storage, read> obbs: array<f32>;

fn three_of(first: u32) -> vec3<f32> {
    return vec3<f32>(obbs[first], obbs[first + 1u], obbs[first + 2u]);
}

/// A box around a child.
fn box_of(child: u32) -> Box {
    if (child & LEAF) == 0u {
        let at = 15u * child;
        let frame = mat3x3<f32>(three_of(at + 3u), three_of(at + 6u), three_of(at + 9u));
        return Box(three_of(at), frame, three_of(at + 12u));
    }
    let item = leaves[child & ~LEAF];
    let content = item_content(item);
    let size = length_1(content.columns[1] - content.columns[0]) + length_1(content.columns[2] - content.columns[0]);
    if size > 1e-30 {
        let box = enclosed(triangle_axes(content.columns, size), content, content);
        // A rejected frame gives negative half-extents.
        if all(box.half_extents >= vec3(0.0)) {
            return box;
        }
    }
    let columns = content.columns;
    return box_from_aabb(min(min(columns[0], columns[1]), columns[2]), max(max(columns[0], columns[1]), columns[2]));
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let unit = slice_item(id, 64u);
    if unit >= slice.end || !is_node(unit, true) {
        return;
    }
    let at = UNIT_WORDS * (target_level.first_unit + unit);
    for (var child = 0u; child < WIDTH; child++) {
        let found = wide_children[WIDTH * unit + child];
        if found == NONE {
            put_nothing(at + child);
            continue;
        }
        let box = box_of(found);
        for (var k = 0u; k < 3u; k++) {
            let slab = slab_of(box.frame, box.half_extents, k);
            let axis = slab.xyz;
            let half = slab.w + 4.0 * ROUNDING * dot(abs(axis), abs(box.center));
            let row = at + 40u * k + child;
            wide_nodes[row] = bitcast<u32>(axis.x);
            wide_nodes[row + 8u] = bitcast<u32>(axis.y);
            wide_nodes[row + 16u] = bitcast<u32>(axis.z);
            wide_nodes[row + 24u] = bitcast<u32>(dot(axis, box.center));
            wide_nodes[row + 32u] = bitcast<u32>(half * (1.0 + 2.0 * ROUNDING));
        }
        wide_nodes[at + 120u + child] = word_of(found);
    }
}

/// An empty slot.
fn put_nothing(at: u32) {
    for (var k = 0u; k < 3u; k++) {
        for (var row = 0u; row < 4u; row++) {
            wide_nodes[at + 40u * k + 8u * row] = 0u;
        }
        wide_nodes[at + 40u * k + 32u] = MINUS_NOWHERE;
    }
    wide_nodes[at + 120u] = EMPTY;
}
