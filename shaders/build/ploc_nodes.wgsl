// Renumbering of a clustered tree, second dispatch.
// Reads: merged pairs, links to parents, the first leaf of each node.
// Writes: nodes, parents and leaves in the form of the radix tree.
// use shared/build/ploc

@group(0) @binding(1) var<storage, read> merges: array<Merge>;
@group(0) @binding(2) var<storage, read> links: array<u32>;
@group(0) @binding(3) var<storage, read> firsts: array<u32>;
@group(0) @binding(4) var<storage, read> leaves: array<u32>;
@group(0) @binding(5) var<storage, read_write> nodes: array<Node>;
@group(0) @binding(6) var<storage, read_write> parents: array<u32>;
@group(0) @binding(7) var<storage, read_write> leaves_out: array<u32>;

/// Writes the parent of a child whose leaves start at `first`, and its leaf. Returns its number in the tree: `slot`, or the leaf.
fn put_child(word: u32, first: u32, slot: u32, parent: u32) -> u32 {
    if (word & LEAF) != 0u {
        leaves_out[first] = leaves[word & ~LEAF];
        parents[arrayLength(&parents) / 2u + first] = parent;
        return LEAF | first;
    }
    parents[slot] = parent;
    return slot;
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let number = slice_item(id, 64u);
    if number >= slice.end {
        return;
    }
    let n_leaves = arrayLength(&links) / 2u;
    if links[n_leaves + number] == NONE {
        // The only leaf of its tree.
        leaves_out[number] = leaves[number];
        parents[n_leaves + number] = NONE;
    }
    let merge = merges[number];
    if merge.n == 0u {
        return;
    }
    let first = firsts[number];
    let link = links[number];
    // A left child has the number of its last leaf, others that of their first.
    let is_left = link != NONE && (link & 1u) == 0u;
    let slot = select(first, first + merge.n - 1u, is_left);
    let split = first + merge.n_left;
    let left = put_child(merge.left, first, split - 1u, slot);
    let right = put_child(merge.right, split, split, slot);
    nodes[slot] = Node(left, right, first, first + merge.n - 1u);
    if link == NONE {
        parents[slot] = NONE;
    }
}
