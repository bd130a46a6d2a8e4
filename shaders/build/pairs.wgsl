// The traversed form of binary trees: each inner node holds the volumes of both children and the words that refer to them.
//
// Children are numbered over all levels of a scene: `target_level.first_node` is added to slots. The word of a leaf is its item, with the
// highest bit set.
// Reads: nodes, leaves, volumes, items.
// Writes: pairs.
// use shared/build/slice
// use shared/build/tree
// use ?pair

struct Level {
    /// The number of the first node of the level.
    first_node: u32,
}

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read_write> pairs: array<vec4<u32>>;
@group(0) @binding(5) var<uniform> target_level: Level;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let node = nodes[slot];
    // The last slot of a tree is empty.
    if node.first == node.last {
        return;
    }
    let at = 2u * CHILD_QUADS * (target_level.first_node + slot);
    put(at, node.left);
    put(at + CHILD_QUADS, node.right);
}

/// Writes a child that starts at a quad.
fn put(at: u32, child: u32) {
    if (child & LEAF) != 0u {
        let item = leaves[child & ~LEAF];
        put_item(at, LEAF | item, item);
    } else {
        put_node(at, target_level.first_node + child, child);
    }
}
