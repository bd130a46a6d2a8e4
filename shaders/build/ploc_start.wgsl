// Clustering, before the first iteration.
// Reads: items in the order of the curve.
// Writes: a cluster for each leaf, the clusters of each tree, their number.
// use shared/build/ploc
// use shared/build/tree/forest
// use ?item

@group(0) @binding(1) var<storage, read> leaves: array<u32>;
@group(0) @binding(2) var<storage, read_write> clusters: array<Cluster>;
@group(0) @binding(3) var<storage, read_write> states: array<TreeState>;
/// The number of clusters before each iteration.
@group(0) @binding(4) var<storage, read_write> remaining: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let position = slice_item(id, 64u);
    if position >= slice.end {
        return;
    }
    let reach = item_reach(leaves[position]);
    let low = vec3<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u));
    let high = vec3<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u));
    clusters[position] = Cluster(bitcast<vec3<f32>>(low), position, bitcast<vec3<f32>>(high), LEAF | position);
    let tree = tree_of(position);
    let range = ranges[tree];
    if position == range.first {
        states[tree] = TreeState(range.first, range.first + range.count, 0u, 0u);
    }
    if position == 0u {
        remaining[0] = arrayLength(&leaves);
    }
}
