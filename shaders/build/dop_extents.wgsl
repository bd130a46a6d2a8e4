// Volumes, `dop`, first dispatch of a frame: extents along its axes, from the leaves up.
// Reads: nodes, parents, leaves, a frame. Writes: the coordinates of both ends of what is below each node of many leaves, from
// the origin.
// Source: Klosowski et al. 1998, three directions at a time.
// use shared/build/slice
// use shared/build/climb
// use shared/build/small_nodes
// use shared/build/fixed_frame

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let leaf = slice_item(group, groups, 64u, local);
    if leaf >= slice.end {
        return;
    }
    // The first leaf of a node of few speaks for all of them.
    var first = leaf;
    var last = leaf;
    var above = parent_of_leaf(leaf);
    while above != NONE {
        let node = nodes[above];
        if !is_small(node) {
            break;
        }
        first = node.first;
        last = node.last;
        above = parents[above];
    }
    if first != leaf || above == NONE {
        return;
    }
    let extent = extent_of_leaves(fixed_frame.frame, vec3(0.0), first, last);
    let low = bitcast<vec3<u32>>(extent.low);
    let high = bitcast<vec3<u32>>(extent.high);
    climb(above, Reach(reach_of(low.x, low.y, low.z).low, reach_of(high.x, high.y, high.z).high));
}
