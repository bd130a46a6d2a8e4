// Volumes, `dop`, first dispatch of a frame: extents along its axes, bottom-up.
// Reads: nodes, parents, leaves, a frame.
// Writes: for each large node the minimum and maximum along each axis, measured from the origin.
// Source: Klosowski et al. 1998, three directions at a time.
// use shared/build/slice
// use shared/build/climb
// use shared/volumes/dop

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let leaf = slice_item(id, 64u);
    if leaf >= slice.end {
        return;
    }
    // The first leaf of a small node handles all leaves of that node.
    var first = leaf;
    var last = leaf;
    var above = parent_of_leaf(leaf);
    for (var step = 0u; step < MAX_HEIGHT && above != NONE; step++) {
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
