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

// part aabbs_and_heights
// Volumes: axis-aligned boxes and heights, bottom-up.
// Reads: parents, leaves.
// Writes: the box and the height of each inner node, and the maximum of the heights.
// use shared/build/slice
// use shared/build/climb
// use build/topology/raise
// use ?item

@group(0) @binding(2) var<storage, read> leaves: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let leaf = slice_item(id, 64u);
    if leaf < slice.end {
        climb(parent_of_leaf(leaf), item_reach(leaves[leaf]));
        raise(leaf);
    }
}

// part treelets
// Volumes, once before the nodes are walked.
//
// A treelet is a subtree of at most `TREELET` leaves whose parent has more; a large node has more, too.
// Reads: nodes, parents, heights.
// Writes: the treelets and the large nodes, in any order; the height of each node; a work-group for each treelet.
// Holds: boxes do not depend on the order of atomics.
// use shared/build/slice
// use shared/build/tree
// use shared/build/pass
// use build/volumes/schedule

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> parents: array<u32>;
@group(0) @binding(3) var<storage, read> heights: array<u32>;
@group(0) @binding(4) var<storage, read_write> schedule: array<atomic<u32>>;

fn is_large(slot: u32) -> bool {
    return nodes[slot].last - nodes[slot].first >= TREELET;
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let n_slots = arrayLength(&heights);
    // Boxes of higher trees are not used.
    let height = min(heights[slot], MAX_HEIGHT - 1u);
    atomicStore(&schedule[height_at(slot, n_slots)], height);
    if height == 0u {
        return;
    }
    if is_large(slot) {
        atomicStore(&schedule[large_at(atomicAdd(&schedule[N_LARGE], 1u), n_slots)], slot);
    } else if parents[slot] == NONE || is_large(parents[slot]) {
        let number = atomicAdd(&schedule[N_TREELETS], 1u);
        atomicStore(&schedule[treelet_at(number)], slot);
        let rows = rows_of(number + 1u);
        atomicMax(&schedule[0], rows.x);
        atomicMax(&schedule[1], rows.y);
    }
}

// part schedule
// Treelets and large nodes: the work-groups of a dispatch over the treelets, the number of treelets and of large nodes; a word for each
// slot, treelets from the start and large nodes from the end; the height of each slot.

const N_TREELETS: u32 = 3u;
const N_LARGE: u32 = 4u;
const HEAD: u32 = 8u;

/// Most leaves of a treelet.
const TREELET: u32 = 512u;

fn treelet_at(number: u32) -> u32 {
    return HEAD + number;
}

fn large_at(number: u32, n_slots: u32) -> u32 {
    return HEAD + n_slots - 1u - number;
}

fn height_at(slot: u32, n_slots: u32) -> u32 {
    return HEAD + n_slots + slot;
}

// part walk
// Nodes in the order of their heights, so that each comes after its children.
//
// A work-group walks a treelet, with a barrier between heights. In the next dispatch, one work-group walks all large nodes. The kernel's
// `visit` computes what belongs to a node.
// use shared/build/slice
// use shared/build/tree
// use build/volumes/schedule

struct Walk {
    /// Whether the large nodes are walked.
    is_large: u32,
}

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> schedule: array<u32>;
@group(0) @binding(7) var<uniform> walk: Walk;
/// The nodes of each treelet in the slots of its leaves, by height; then the large nodes.
@group(0) @binding(8) var<storage, read_write> order: array<u32>;

/// The number of nodes of each height, then where they start in `order`, then where they end.
var<workgroup> height_ends: array<atomic<u32>, MAX_HEIGHT>;
var<workgroup> greatest: atomic<u32>;
var<workgroup> n_heights: u32;

/// The nodes of a work-group are among `n` slots from `first` on, or `n` large nodes.
struct Candidates {
    first: u32,
    n: u32,
}

fn candidates_of(number: u32) -> Candidates {
    if walk.is_large != 0u {
        return Candidates(0u, schedule[N_LARGE]);
    }
    if number >= schedule[N_TREELETS] {
        return Candidates();
    }
    let root = nodes[schedule[treelet_at(number)]];
    return Candidates(root.first, root.last - root.first + 1u);
}

/// The slot of a candidate; `NONE` where it belongs to another treelet or to no node.
fn candidate(all: Candidates, i: u32, n_slots: u32) -> u32 {
    if walk.is_large != 0u {
        return schedule[large_at(i, n_slots)];
    }
    let slot = all.first + i;
    let node = nodes[slot];
    let is_below = node.first >= all.first && node.last < all.first + all.n;
    return select(NONE, slot, is_below && schedule[height_at(slot, n_slots)] != 0u);
}

/// Visits the nodes of a work-group of 64 invocations.
fn walk_nodes(id: Invocation) {
    let local = id.local;
    let n_slots = arrayLength(&order) / 2u;
    let all = candidates_of(group_index(id));
    let first = select(all.first, n_slots, walk.is_large != 0u);
    for (var i = local; i < all.n; i += 64u) {
        let slot = candidate(all, i, n_slots);
        if slot != NONE {
            let height = schedule[height_at(slot, n_slots)];
            atomicAdd(&height_ends[height], 1u);
            atomicMax(&greatest, height);
        }
    }
    workgroupBarrier();
    if local == 0u {
        let last = atomicLoad(&greatest);
        var n_before = 0u;
        for (var height = 1u; height <= last; height++) {
            n_before += atomicExchange(&height_ends[height], n_before);
        }
        n_heights = last;
    }
    let last = workgroupUniformLoad(&n_heights);
    for (var i = local; i < all.n; i += 64u) {
        let slot = candidate(all, i, n_slots);
        if slot != NONE {
            order[first + atomicAdd(&height_ends[schedule[height_at(slot, n_slots)]], 1u)] = slot;
        }
    }
    storageBarrier(); // Shared in this work-group.
    workgroupBarrier();
    var start = 0u;
    for (var height = 1u; height <= last; height++) {
        let end = atomicLoad(&height_ends[height]);
        for (var i = start + local; i < end; i += 64u) {
            visit(order[first + i]);
        }
        start = end;
        storageBarrier(); // Shared in this work-group.
    }
}

// part merge
// Volumes: oriented boxes.
// Reads: boxes of the children, axis-aligned boxes.
// Writes: one box per node; the axis-aligned one if the oriented box does not have less area.
// Holds: a box contains the boxes of its children and its items exactly; see shared/volumes/enclosure.
// use build/volumes/walk
// use shared/volumes/boxes
// use ?item
// use ?rule

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
    walk_nodes(id);
}

fn visit(slot: u32) {
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
// Volumes, `pca-unbounded`, first dispatches: moments of everything below a node, and its principal axes.
// Reads: nodes, leaves, moments of the children.
// Writes: moments; the frame of each node and a point of it as the center of its box.
// Source: moments of triangles by area (Gottschalk et al. 1996), merged by the parallel-axis theorem (Chan, Golub, LeVeque 1979).
//
// Covariances are means, so that merging only needs the fraction of each child. Areas are clamped, so that no sum overflows; those
// that underflow count equally. Either changes a frame, never whether a box encloses its node.
// use build/volumes/walk
// use shared/volumes/boxes
// use shared/volumes/bounded
// use ?item

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
    walk_nodes(id);
}

fn visit(slot: u32) {
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
