// Volumes: axis-aligned boxes, bottom-up.
// Reads: parents, leaves.
// Writes: the box of each inner node. Its coordinates are copies of coordinates of the items.
// use shared/build/slice
// use shared/build/climb
// use ?item

@group(0) @binding(2) var<storage, read> leaves: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let leaf = slice_item(id, 64u);
    if leaf < slice.end {
        climb(parent_of_leaf(leaf), item_reach(leaves[leaf]));
    }
}
