// Wide nodes that are aligned with the axes, in the layout of shared/bvh/node.
// Reads: binary tree, boxes, items, the order of wide nodes and their children.
// Writes: one node for each.
// Holds: boxes are copies of coordinates.
// use shared/build/wide_target
// use shared/build/wide/box

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let unit = slice_item(id, 64u);
    if unit >= slice.end || !is_node(unit, false) {
        return;
    }
    let at = UNIT_WORDS * (target_level.first_unit + unit);
    for (var child = 0u; child < WIDTH; child++) {
        var word = EMPTY;
        var box = array<u32, 6>(NOWHERE, NOWHERE, NOWHERE, MINUS_NOWHERE, MINUS_NOWHERE, MINUS_NOWHERE);
        let found = wide_children[WIDTH * unit + child];
        if found != NONE {
            word = word_of(found);
            box = box_of(found);
        }
        for (var k = 0u; k < 3u; k++) {
            wide_nodes[at + 16u * k + child] = box[k];
            wide_nodes[at + 16u * k + 8u + child] = box[k + 3u];
        }
        wide_nodes[at + 48u + child] = word;
    }
}
