// Clustering, first dispatch of an iteration.
// Reads: clusters.
// Writes: the partner of each cluster; itself if it has none.
// use shared/build/ploc
// use shared/build/tree/forest

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> states: array<TreeState>;
@group(0) @binding(3) var<storage, read> remaining: array<u32>;
@group(0) @binding(4) var<uniform> iteration: Iteration;
@group(0) @binding(5) var<storage, read_write> partners: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= min(remaining[iteration.number], slice.end) {
        return;
    }
    let own = clusters[i];
    let state = states[tree_of(own.number)];
    // Positions count within the tree.
    let at = i - state.first;
    let n = state.end - state.first;
    if state.is_forced != 0u {
        partners[i] = state.first + select(at, at ^ 1u, (at ^ 1u) < n);
        return;
    }
    let radius = radius_of(iteration);
    let last = min(at + radius, n - 1u);
    var nearest = NOT_NEAR;
    for (var other = max(at, radius) - radius; other <= last; other++) {
        if other != at {
            nearest = nearer(nearest, Nearness(union_area(own, clusters[state.first + other]), at ^ other));
        }
    }
    partners[i] = select(i, state.first + (at ^ nearest.difference), n > 1u);
}
