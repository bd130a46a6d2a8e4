// Volumes, `dop`, first dispatch of a frame: extents along its axes, from the leaves up.
// Reads: parents, leaves, a frame. Writes: the coordinates of both ends of what is below each inner node, from the origin.
// Source: Klosowski et al. 1998, three directions at a time.
// use shared/build/slice
// use shared/build/climb
// use shared/build/enclosure
// use shared/build/fixed
// use ?item

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
    let extent = extent_of(fixed.frame, vec3(0.0), item_content(leaves[leaf]));
    let low = bitcast<vec3<u32>>(extent.low);
    let high = bitcast<vec3<u32>>(extent.high);
    climb(leaf, Reach(reach_of(low.x, low.y, low.z).low, reach_of(high.x, high.y, high.z).high));
}
