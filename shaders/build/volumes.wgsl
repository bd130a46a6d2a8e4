// Bounding volumes of binary trees: axis-aligned boxes from the leaves up, oriented ones by each strategy.

// part aabbs
// Volumes: axis-aligned boxes, bottom-up.
// Reads: parents, leaves.
// Writes: the box of each inner node. Its coordinates are copies of coordinates of the items.
// use shared/build/slice
// use shared/build/climb
// use ?item

@group(0) @binding(2) var<storage, read> leaves: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let leaf = slice_item(id, 64u);
    if leaf < slice.end {
        climb(parent_of_leaf(leaf), item_reach(leaves[leaf]));
    }
}

// part levels
// Volumes, once before the levels.
// Reads: heights, nodes sorted by height.
// Writes: for each height, the number of nodes that are not higher.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> heights: array<u32>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read_write> ends: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= slice.end {
        return;
    }
    let height = heights[order[i]];
    // The last node of this height.
    if i + 1u == arrayLength(&heights) || heights[order[i + 1u]] != height {
        ends[height] = i + 1u;
    }
}

// part level_slices
// Volumes, once before the levels, where the host does not wait for their sizes.
// Reads: for each height, the number of nodes that are not higher; zero for a height without nodes.
// Writes: for each height, the slice of its nodes, and the work-groups of a dispatch over it.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> ends: array<u32>;
/// A slice for each height, as far apart as every device lets uniforms be.
@group(0) @binding(2) var<storage, read_write> slices: array<u32>;
@group(0) @binding(3) var<storage, read_write> groups: array<u32>;

/// Words between slices.
const SLICE_WORDS: u32 = 64u;

/// Work-groups along one axis, at most.
const MOST_GROUPS: u32 = 65535u;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let height = slice_item(id, 64u);
    if height >= slice.end {
        return;
    }
    var first = 0u;
    for (var lower = 0u; lower < height; lower++) {
        first = max(first, ends[lower]);
    }
    let end = max(first, ends[height]);
    slices[SLICE_WORDS * height] = first;
    slices[SLICE_WORDS * height + 1u] = end;
    slices[SLICE_WORDS * height + 2u] = 0u;
    // In rows of equal length, as on the host.
    let n = (end - first + 63u) / 64u;
    let rows = max((n + MOST_GROUPS - 1u) / MOST_GROUPS, 1u);
    groups[3u * height] = (n + rows - 1u) / rows;
    groups[3u * height + 1u] = rows;
    groups[3u * height + 2u] = 1u;
}

// part merge
// Volumes: oriented boxes, one dispatch per height.
// Reads: boxes of the children, axis-aligned boxes.
// Writes: one box per node; the axis-aligned one if the oriented box does not have less area.
// Holds: a box contains the boxes of its children and its items exactly; see shared/volumes/enclosure.
// use shared/build/slice
// use shared/build/tree
// use shared/volumes/boxes
// use ?item
// use ?rule

@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> nodes: array<Node>;
@group(0) @binding(3) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read> aabbs: array<f32>;

fn child_content(child: u32) -> Content {
    if (child & LEAF) != 0u {
        return item_content(leaves[child & ~LEAF]);
    }
    let columns = mat3x3<f32>(part(child, 1u), part(child, 2u), part(child, 3u));
    return Content(true, part(child, 0u), columns, part(child, 4u));
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= slice.end {
        return;
    }
    let slot = order[i];
    let a = child_content(nodes[slot].left);
    let b = child_content(nodes[slot].right);
    let at = 6u * slot;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    var volume = box_from_aabb(low, high);
    let oriented = enclosed(frame_of(a, b), a, b);
    // A rejected box has negative half-extents, which can multiply to a positive area.
    if all(oriented.half_extents >= vec3(0.0)) && half_area(oriented.half_extents) < half_area(0.5 * (high - low)) {
        volume = oriented;
    }
    put_box(slot, volume);
}

// part moments
// Volumes, `pca-unbounded`, first dispatches, one per height: moments of everything below a node, and its principal axes.
// Reads: nodes, leaves, moments of the children.
// Writes: moments; the frame of each node and a point of it as the center of its box.
// Source: moments of triangles by area (Gottschalk et al. 1996), merged by the parallel-axis theorem (Chan, Golub, LeVeque 1979).
//
// Covariances are means, so that merging only needs the fraction of each child. Areas are clamped, so that no sum overflows; those
// that underflow count equally. Either changes a frame, never whether a box encloses its node.
// use shared/build/slice
// use shared/build/tree
// use shared/volumes/boxes
// use shared/volumes/bounded
// use ?item

@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> nodes: array<Node>;
@group(0) @binding(3) var<storage, read> leaves: array<u32>;
/// Ten floats per node: weight, mean, squares of the covariance, products of the covariance.
@group(0) @binding(6) var<storage, read_write> node_moments: array<f32>;

const MAX_WEIGHT: f32 = 1e28;

fn moment_three(at: u32) -> vec3<f32> {
    return vec3<f32>(node_moments[at], node_moments[at + 1u], node_moments[at + 2u]);
}

fn put_three(at: u32, v: vec3<f32>) {
    node_moments[at] = v.x;
    node_moments[at + 1u] = v.y;
    node_moments[at + 2u] = v.z;
}

/// Moments of a child. Of a triangle, a twelfth of the sum over its corners.
fn moments_below(child: u32) -> Moments {
    if (child & LEAF) == 0u {
        let at = 10u * child;
        return Moments(node_moments[at], moment_three(at + 1u), moment_three(at + 4u), moment_three(at + 7u));
    }
    let content = item_content(leaves[child & ~LEAF]);
    let weight = min(content_area(content), MAX_WEIGHT);
    if content.is_box {
        let edges = sides(content);
        var moments = Moments(weight, content.center, vec3(0.0), vec3(0.0));
        for (var k = 0u; k < 3u; k++) {
            moments = add_square(moments, edges[k], 1.0);
        }
        return moments;
    }
    let ab = content.columns[1] - content.columns[0];
    let ac = content.columns[2] - content.columns[0];
    let to_mean = (ab + ac) / 3.0;
    var moments = Moments(weight, content.columns[0] + to_mean, vec3(0.0), vec3(0.0));
    moments = add_square(moments, to_mean, 1.0 / 12.0);
    moments = add_square(moments, ab - to_mean, 1.0 / 12.0);
    return add_square(moments, ac - to_mean, 1.0 / 12.0);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= slice.end {
        return;
    }
    let slot = order[i];
    let a = moments_below(nodes[slot].left);
    let b = moments_below(nodes[slot].right);
    let sum = a.weight + b.weight;
    let fraction = select(0.5, b.weight / max(sum, 1e-37), sum > 1e-36);
    let apart = b.mean - a.mean;
    var all = Moments(min(sum, MAX_WEIGHT), a.mean + fraction * apart, mix(a.diagonal, b.diagonal, fraction), mix(a.coupling, b.coupling, fraction));
    all = add_square(all, apart, fraction * (1.0 - fraction));
    let at = 10u * slot;
    node_moments[at] = all.weight;
    put_three(at + 1u, all.mean);
    put_three(at + 4u, all.diagonal);
    put_three(at + 7u, all.coupling);
    let greatest = max(all.diagonal.x, max(all.diagonal.y, all.diagonal.z));
    var frame = IDENTITY;
    if greatest > 1e-36 {
        frame = principal_axes(all.diagonal / greatest, all.coupling / greatest);
    }
    put_box(slot, Box(item_content(leaves[nodes[slot].first]).center, frame, vec3(0.0)));
}

// part point_extents
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

// part point_boxes
// Volumes, `pca-unbounded`, third dispatch: the box of each node, or the axis-aligned one if that has no more area.
// Reads: extents, axis-aligned boxes, nodes, leaves; frames and points in the boxes.
// Writes: boxes.
// Holds: a box contains the items below it exactly; see shared/volumes/enclosure.
// use shared/build/slice
// use shared/build/ordered
// use shared/volumes/boxes
// use shared/volumes/dop

@group(0) @binding(3) var<storage, read> ends: array<u32>;
@group(0) @binding(6) var<storage, read> aabbs: array<f32>;

fn end_three(at: u32, first: u32) -> vec3<f32> {
    let words = vec3<u32>(end_of(ends[at], first), end_of(ends[at + 1u], first), end_of(ends[at + 2u], first));
    return bitcast<vec3<f32>>(words);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let node = nodes[slot];
    if node.last == node.first {
        return;
    }
    let at = 6u * slot;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    let origin = part(slot, 0u);
    let frame = mat3x3<f32>(part(slot, 1u), part(slot, 2u), part(slot, 3u));
    var extent = Extent();
    if is_small(node) {
        extent = extent_of_leaves(frame, origin, node.first, node.last);
    } else {
        // No item reaches farther from the point than the axis-aligned box; four roundings cover the difference and the sum.
        let reach = max(abs(low - origin), abs(high - origin));
        extent = Extent(end_three(at, 0u), end_three(at + 3u, 3u), length_1(reach) * (1.0 + 4.0 * ROUNDING));
    }
    let oriented = box_around(frame, origin, extent, skewness(frame) + 13.0 * ROUNDING);
    var volume = box_from_aabb(low, high);
    // A rejected box has negative half-extents, which can multiply to a positive area.
    if all(oriented.half_extents >= vec3(0.0)) && half_area(oriented.half_extents) < half_area(0.5 * (high - low)) {
        volume = oriented;
    }
    put_box(slot, volume);
}

// part dop_extents
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

// part dop_boxes
// Volumes, `dop`, second dispatch of a frame: the box along this frame replaces the node's box if it has less area.
// Reads: extents along the frame, axis-aligned boxes, nodes, leaves.
// Writes: boxes.
// Holds: a box contains the items below it exactly; see shared/volumes/enclosure.
// use shared/build/slice
// use shared/volumes/boxes
// use shared/volumes/dop

@group(0) @binding(3) var<storage, read> ends: array<f32>;
@group(0) @binding(6) var<storage, read> aabbs: array<f32>;

fn three(at: u32, is_end: bool) -> vec3<f32> {
    if is_end {
        return vec3<f32>(ends[at], ends[at + 1u], ends[at + 2u]);
    }
    return vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
}

/// The box along the frame from the extents computed bottom-up. No item reaches farther from the origin than its axis-aligned
/// box; three roundings cover the sum.
fn box_of_large_node(slot: u32) -> Box {
    let reach = max(abs(three(6u * slot, false)), abs(three(6u * slot + 3u, false)));
    let size = length_1(reach) * (1.0 + 3.0 * ROUNDING);
    let extent = Extent(three(6u * slot, true), three(6u * slot + 3u, true), size);
    return box_around(fixed_frame.frame, vec3(0.0), extent, fixed_frame.skewness);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let node = nodes[slot];
    if node.last == node.first {
        return;
    }
    var volume = Box();
    if is_small(node) {
        let origin = item_content(leaves[node.first]).center;
        let extent = extent_of_leaves(fixed_frame.frame, origin, node.first, node.last);
        volume = box_around(fixed_frame.frame, origin, extent, fixed_frame.skewness);
    } else {
        volume = box_of_large_node(slot);
    }
    if half_area(volume.half_extents) < half_area(part(slot, 4u)) {
        put_box(slot, volume);
    }
}

// part axis_aligned
// Volumes, `dop`, before the first frame: converts axis-aligned boxes.
// Reads: axis-aligned boxes.
// Writes: the same boxes as center, identity frame and half-extents.
// use shared/build/slice
// use shared/volumes/boxes

@group(0) @binding(1) var<storage, read> aabbs: array<f32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let at = 6u * slot;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    put_box(slot, box_from_aabb(low, high));
}
