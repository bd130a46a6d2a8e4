// Clustering, last dispatch of an iteration, for each tree.
// Reads: which clusters are kept, and the number of kept clusters before each.
// Writes: the clusters of each tree, their number, the most of a tree.
// use shared/build/ploc

@group(0) @binding(1) var<storage, read> kept: array<u32>;
@group(0) @binding(2) var<storage, read> prefixes: array<u32>;
@group(0) @binding(3) var<storage, read> states: array<TreeState>;
@group(0) @binding(4) var<uniform> iteration: Iteration;
@group(0) @binding(5) var<storage, read_write> states_out: array<TreeState>;
/// The number of clusters before each iteration, and the most of a tree.
@group(0) @binding(6) var<storage, read_write> remaining: array<u32>;
@group(0) @binding(7) var<storage, read_write> longest: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let tree = slice_item(id, 64u);
    if tree >= slice.end {
        return;
    }
    let state = states[tree];
    // A tree without items has no clusters.
    if state.first == state.end {
        return;
    }
    let first = prefixes[state.first];
    let end = prefixes[state.end - 1u] + kept[state.end - 1u];
    let is_forced = is_forced_after(state.end - state.first, end - first, state.is_forced != 0u);
    states_out[tree] = TreeState(first, end, select(0u, 1u, is_forced), 0u);
    atomicMax(&longest[iteration.number + 1u], end - first);
    if state.end == remaining[iteration.number] {
        remaining[iteration.number + 1u] = end;
    }
}
