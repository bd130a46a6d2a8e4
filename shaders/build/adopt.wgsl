// A tree that was built on its own takes the place of a tree of a level.
// Reads: nodes, parents and leaves, which are numbered from 0.
// Writes: the same, numbered over all trees of the level.
// use shared/build/slice
// use shared/build/tree

struct Place {
    /// First item of the tree among those of the level.
    first: u32,
}

@group(0) @binding(1) var<uniform> place: Place;
@group(0) @binding(2) var<storage, read> own_nodes: array<Node>;
@group(0) @binding(3) var<storage, read> own_parents: array<u32>;
@group(0) @binding(4) var<storage, read> own_leaves: array<u32>;
@group(0) @binding(5) var<storage, read_write> nodes: array<Node>;
@group(0) @binding(6) var<storage, read_write> parents: array<u32>;
@group(0) @binding(7) var<storage, read_write> leaves: array<u32>;

/// A parent among the nodes of the level.
fn moved(parent: u32) -> u32 {
    return select(place.first + parent, NONE, parent == NONE);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let item = slice_item(id, 64u);
    if item >= slice.end {
        return;
    }
    let slot = place.first + item;
    let node = own_nodes[item];
    // The highest bit of a leaf stays.
    nodes[slot] = Node(node.left + place.first, node.right + place.first, node.first + place.first, node.last + place.first);
    parents[slot] = moved(own_parents[item]);
    parents[arrayLength(&parents) / 2u + slot] = moved(own_parents[arrayLength(&own_parents) / 2u + item]);
    leaves[slot] = own_leaves[item] + place.first;
}
