// Wide nodes of one level of a BVH, from the nodes of the level above.
// Reads: binary tree, boxes, the wide nodes of this level as slots of their binary nodes.
// Writes: the size of an aligned node for each wide node by slot, except for roots; the wide nodes of the next level, in any order.
// Holds: which nodes are wide does not depend on the order of atomics.
// use shared/build/wide
// use shared/build/wide_word

struct Level {
    /// Number of levels above.
    level: u32,
    /// Wide nodes of the first level.
    n_first: u32,
    /// Number of invocations: `i` handles the nodes `i`, `i + n_invocations` and so on.
    n_invocations: u32,
}

@group(0) @binding(3) var<uniform> wide_level: Level;
@group(0) @binding(4) var<storage, read> queue_in: array<u32>;
@group(0) @binding(5) var<storage, read_write> queue_out: array<u32>;
/// Wide nodes of each level.
@group(0) @binding(6) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> units: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let first = slice_item(id, 64u);
    var n = wide_level.n_first;
    if wide_level.level > 0u {
        n = atomicLoad(&counts[wide_level.level]);
    }
    if first >= slice.end {
        return;
    }
    for (var i = first; i < n; i += wide_level.n_invocations) {
        open(queue_in[i]);
    }
}

/// Finds the children of a wide node, and those of them that are wide nodes of the next level.
fn open(slot: u32) {
    let children = children_of(slot);
    if wide_level.level > 0u {
        units[slot] = ALIGNED;
    }
    for (var child = 0u; child < children.n; child++) {
        if !is_leaf(children.words[child]) {
            let at = atomicAdd(&counts[wide_level.level + 1u], 1u);
            queue_out[at] = children.words[child];
        }
    }
}
