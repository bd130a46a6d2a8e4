// Volumes, `pca-unbounded`, second dispatch: extents of each large node along its own axes, from all leaves below it.
// Reads: frames and points of the nodes, nodes, parents, leaves.
// Writes: for each large node the minimum and maximum along each axis, measured from its point.
// Holds: extents are maxima of integers, so the order of arrival does not matter.
// use shared/build/slice
// use shared/build/ordered
// use shared/volumes/dop

@group(0) @binding(3) var<storage, read_write> ends: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> frames: array<f32>;
/// Parents of inner nodes by slot, followed by parents of leaves by position.
@group(0) @binding(6) var<storage, read> parents: array<u32>;

fn frame_three(at: u32) -> vec3<f32> {
    return vec3<f32>(frames[at], frames[at + 1u], frames[at + 2u]);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let leaf = slice_item(id, 64u);
    if leaf >= slice.end {
        return;
    }
    // The first leaf of a small node handles all leaves of that node.
    var first = leaf;
    var last = leaf;
    var above = parents[arrayLength(&parents) / 2u + leaf];
    for (var step = 0u; step < MAX_HEIGHT && above != NONE; step++) {
        let node = nodes[above];
        if !is_small(node) {
            break;
        }
        first = node.first;
        last = node.last;
        above = parents[above];
    }
    if first != leaf {
        return;
    }
    for (var step = 0u; step < MAX_HEIGHT && above != NONE; step++) {
        let at = 15u * above;
        let frame = mat3x3<f32>(frame_three(at + 3u), frame_three(at + 6u), frame_three(at + 9u));
        let extent = extent_of_leaves(frame, frame_three(at), first, last);
        let low = bitcast<vec3<u32>>(extent.low);
        let high = bitcast<vec3<u32>>(extent.high);
        for (var k = 0u; k < 3u; k++) {
            atomicMax(&ends[6u * above + k], ~ordered(low[k]));
            atomicMax(&ends[6u * above + 3u + k], ordered(high[k]));
        }
        above = parents[above];
    }
}
