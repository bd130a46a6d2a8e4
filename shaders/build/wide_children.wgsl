// The children of each wide node, which stay the same while only boxes change.
// Reads: binary tree, boxes, the order of wide nodes.
// Writes: eight words for each wide node, as in `Node`, by its first unit; `NONE` where there is no child.
// use shared/build/wide

@group(0) @binding(3) var<storage, read> wide_slots: array<u32>;
@group(0) @binding(4) var<storage, read_write> wide_children: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let unit = slice_item(id, 64u);
    if unit >= slice.end || wide_slots[unit] == 0u {
        return;
    }
    let children = children_of(wide_slots[unit] - 1u);
    for (var child = 0u; child < WIDTH; child++) {
        wide_children[WIDTH * unit + child] = select(NONE, children.words[child], child < children.n);
    }
}
