// Binary radix trees over sorted codes, and what belongs to their nodes.

// part tree_indices
// Sort, only where there are several trees.
// Writes: the tree of each item, which is the most significant word of its key.
// use shared/build/slice
// use shared/build/tree/forest

@group(0) @binding(1) var<storage, read_write> tree_indices: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let item = slice_item(id, 64u);
    if item < slice.end {
        tree_indices[item] = tree_of(item);
    }
}

// part tree
// Radix tree.
// Reads: sorted codes.
// Writes: one inner node for each leaf but the last of a tree, and parents.
// Holds: each node splits its range at the highest differing bit of (code, position). The integers equal the CPU's.
// Source: Karras 2012.
// use shared/build/slice
// use shared/build/tree/forest
// use shared/build/tree
// use ?code

@group(0) @binding(1) var<storage, read_write> nodes: array<Node>;
/// Parents of inner nodes by slot, followed by parents of leaves by position.
@group(0) @binding(2) var<storage, read_write> parents: array<u32>;

/// Length of the common prefix of leaves i and j of a tree, of code and position; −1 for a leaf outside the tree.
fn common_prefix(range: Range, i: i32, j: i32) -> i32 {
    if j < 0 || j >= i32(range.count) {
        return -1;
    }
    let bits = common_bits(range.first + u32(i), range.first + u32(j));
    return i32(select(bits, CODE_BITS + countLeadingZeros(u32(i ^ j)), bits == CODE_BITS));
}

/// The other end of the range of node `i` in direction `toward`: the farthest leaf whose common prefix is longer than that of
/// the neighbor on the opposite side.
fn range_end(range: Range, i: i32, toward: i32) -> i32 {
    let least = common_prefix(range, i, i - toward);
    var reach = 2;
    while common_prefix(range, i, i + reach * toward) > least {
        reach *= 2;
    }
    var length = 0;
    for (var step = reach / 2; step >= 1; step /= 2) {
        if common_prefix(range, i, i + (length + step) * toward) > least {
            length += step;
        }
    }
    return i + length * toward;
}

/// Last leaf of the lower part of the range between `i` and `end`.
fn find_split(range: Range, i: i32, end: i32, toward: i32) -> i32 {
    let shared_bits = common_prefix(range, i, end);
    var offset = 0;
    var step = abs(end - i);
    while step > 1 {
        step = (step + 1) / 2;
        if common_prefix(range, i, i + (offset + step) * toward) > shared_bits {
            offset += step;
        }
    }
    return i + offset * toward + min(toward, 0);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let range = ranges[tree_of(slot)];
    let n_slots = arrayLength(&parents) / 2u;
    let i = i32(slot - range.first);
    if i == 0 {
        // The root, or the only leaf.
        parents[select(slot, n_slots + slot, range.count == 1u)] = NONE;
    }
    if i + 1 >= i32(range.count) {
        return;
    }
    let toward = select(-1, 1, common_prefix(range, i, i + 1) > common_prefix(range, i, i - 1));
    let end = range_end(range, i, toward);
    let split = range.first + u32(find_split(range, i, end, toward));
    let first = range.first + u32(min(i, end));
    let last = range.first + u32(max(i, end));
    let left_is_leaf = first == split;
    let right_is_leaf = split + 1u == last;
    nodes[slot] = Node(
        select(split, split | LEAF, left_is_leaf),
        select(split + 1u, (split + 1u) | LEAF, right_is_leaf),
        first,
        last,
    );
    parents[select(split, n_slots + split, left_is_leaf)] = slot;
    parents[select(split + 1u, n_slots + split + 1u, right_is_leaf)] = slot;
}

// part heights
// Tree heights, bottom-up.
// Reads: parents.
// Writes: the height of each inner node in nodes, including the leaf, and the maximum over all nodes.
// use shared/build/slice
// use build/topology/raise

/// Parents of inner nodes by slot, followed by parents of leaves by position.
@group(0) @binding(6) var<storage, read> parents: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let leaf = slice_item(id, 64u);
    if leaf < slice.end {
        raise(leaf);
    }
}

// part raise
// The height of each inner node in nodes, including the leaf, and the maximum over all nodes.
// Holds: the atomic word that identifies the second child also carries the height, so no other memory must be visible with it.
// 0 means that no child has arrived.
// use shared/build/tree

@group(0) @binding(7) var<storage, read_write> heights: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read_write> depth: atomic<u32>;

/// Raises the heights of the nodes above a leaf, from the `parents` of the kernel.
fn raise(leaf: u32) {
    var height = 1u;
    var node = parents[arrayLength(&parents) / 2u + leaf];
    while node != NONE {
        let sibling = atomicExchange(&heights[node], height);
        if sibling == 0u {
            return;
        }
        height = 1u + max(height, sibling);
        atomicStore(&heights[node], height);
        node = parents[node];
    }
    atomicMax(&depth, height);
}

// part adopt
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
