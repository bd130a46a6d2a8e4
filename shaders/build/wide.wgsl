// Eight-wide BVHs from binary trees, with all their dispatches.

// part levels
// Wide nodes below a list of them: a work-group for each, which finds those of the levels below one after another.
//
// A subtree has the slots of its leaves to itself, so the work-group keeps its wide nodes there, in the order in which it finds them. Where
// a level has more of them than a work-group should go on with, it leaves that level to the work-groups of the next pass, which the device
// dispatches. The last pass leaves nothing.
// Reads: binary tree, boxes, wide nodes with the number of levels above each.
// Writes: the kind of each wide node by slot, aligned, except for roots; the wide nodes for the next pass, in any order, and its
// work-groups; the depth.
// Holds: which nodes are wide does not depend on the order of atomics.
// use shared/build/wide
// use shared/build/wide_word
// use shared/build/pass
// const GROUP

struct Limits {
    /// Most wide nodes of a level with which a work-group goes on.
    most: u32,
}

@group(0) @binding(3) var<uniform> wide_limits: Limits;
/// Slot and level of each wide node.
@group(0) @binding(4) var<storage, read> queue_in: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> queue_out: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> pass_in: PassSize;
@group(0) @binding(7) var<storage, read_write> pass_out: NextPass;
@group(0) @binding(8) var<storage, read_write> kinds: array<u32>;
/// The wide nodes that each work-group found, in the slots of its subtree.
@group(0) @binding(9) var<storage, read_write> found: array<u32>;

/// The wide nodes of a level, among those that a work-group found from slot `first` on.
struct Span {
    first: u32,
    start: u32,
    end: u32,
    level: u32,
}

var<workgroup> span: Span;
var<workgroup> n_found: atomic<u32>;
var<workgroup> first_left: u32;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let number = slice.first + group_index(id);
    let local = id.local;
    if local == 0u && number < pass_in.n {
        let root = queue_in[number];
        let first = nodes[root.x].first;
        found[first] = root.x;
        atomicStore(&n_found, 1u);
        span = Span(first, 0u, 1u, root.y);
    }
    loop {
        let now = workgroupUniformLoad(&span);
        let n = now.end - now.start;
        if n == 0u || n > wide_limits.most {
            break;
        }
        for (var i = now.start + local; i < now.end; i += GROUP) {
            open(now, found[now.first + i]);
        }
        storageBarrier(); // Shared in this work-group.
        workgroupBarrier();
        if local == 0u {
            span = Span(now.first, now.end, atomicLoad(&n_found), now.level + 1u);
        }
    }
    let left = workgroupUniformLoad(&span);
    let n = left.end - left.start;
    if local == 0u {
        atomicMax(&pass_out.depth, left.level);
        if n > 0u {
            first_left = atomicAdd(&pass_out.n, n);
            let rows = rows_of(first_left + n);
            atomicMax(&pass_out.groups_x, rows.x);
            atomicMax(&pass_out.groups_y, rows.y);
        }
    }
    let first = workgroupUniformLoad(&first_left);
    for (var i = local; i < n; i += GROUP) {
        queue_out[first + i] = vec2<u32>(found[left.first + left.start + i], left.level);
    }
}

/// Finds the children of a wide node, and those of them that are wide nodes of the next level.
fn open(now: Span, slot: u32) {
    let children = children_of(slot);
    if now.level > 0u {
        kinds[slot] = ALIGNED;
    }
    for (var child = 0u; child < children.n; child++) {
        if !is_leaf(children.words[child]) {
            found[now.first + atomicAdd(&n_found, 1u)] = children.words[child];
        }
    }
}

// part kinds
// The kind of each wide node but roots. Without this pass all nodes are aligned.
//
// A node is oriented where that lowers the predicted cost: what its test costs more, for rays that enter its own box, is less than
// what the smaller boxes of its children save. Costs are those of `canted_wide::Costs`.
// Reads: binary tree, aligned and oriented boxes, triangles, which binary nodes are wide ones.
// Writes: kinds of wide nodes by slot.
// use shared/build/wide
// use shared/build/wide_word
// use shared/volumes/item/triangles
// use shared/build/length

@group(0) @binding(3) var<storage, read_write> kinds: array<u32>;
@group(0) @binding(4) var<storage, read> leaves: array<u32>;
/// Fifteen floats per inner node: center, three axes, half-extents.
@group(0) @binding(5) var<storage, read> obbs: array<f32>;

/// Cost of an oriented node beyond that of an aligned one, which is 1, and of a leaf.
const MORE_FOR_ORIENTED: f32 = 1.2;
const LEAF_COST: f32 = 1.92;

/// Half the surface areas of a child's boxes: aligned, oriented.
fn areas_of(child: u32) -> vec2<f32> {
    if (child & LEAF) != 0u {
        let item = leaves[child & ~LEAF];
        let a = corner(item, 0u);
        let b = corner(item, 1u);
        let c = corner(item, 2u);
        // A flat box in the plane of the triangle, along its longest edge.
        return vec2<f32>(half_area_of(min(min(a, b), c), max(max(a, b), c)), length_of(cross(b - a, c - a)));
    }
    let at = 6u * child;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    let half = vec3<f32>(obbs[15u * child + 12u], obbs[15u * child + 13u], obbs[15u * child + 14u]);
    return vec2<f32>(half_area_of(low, high), 4.0 * (half.x * half.y + half.y * half.z + half.z * half.x));
}

fn kind_of(slot: u32, children: Children) -> u32 {
    // Which box the parent stores is not known here; that of the binary tree is.
    var gain = -MORE_FOR_ORIENTED * areas_of(slot).x;
    for (var child = 0u; child < children.n; child++) {
        let areas = areas_of(children.words[child]);
        gain += (areas.x - areas.y) * select(1.0, LEAF_COST, is_leaf(children.words[child]));
    }
    return select(ALIGNED, ORIENTED, gain > 0.0);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot < slice.end && kinds[slot] != 0u {
        kinds[slot] = kind_of(slot, children_of(slot));
    }
}

// part slots
// The order of wide nodes in memory: each tree has room of its own, in which the root comes first, then all others by the slots of
// their binary nodes.
// Reads: kinds of wide nodes, the number of them before each slot, the first unit of each tree.
// Writes: the word of each wide node by slot; the slot of each wide node by its unit, plus one.
// use shared/build/slice
// use shared/build/wide_word
// use shared/build/tree/forest
// const MAX_LEAF
// const UNIT_QUADS

@group(0) @binding(1) var<storage, read> kinds: array<u32>;
@group(0) @binding(2) var<storage, read> prefixes: array<u32>;
/// The first unit of each tree, and the end.
@group(0) @binding(3) var<storage, read> first_units: array<u32>;
@group(0) @binding(4) var<storage, read_write> wide_words: array<u32>;
@group(0) @binding(5) var<storage, read_write> wide_slots: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let tree = tree_of(slot);
    let range = ranges[tree];
    let is_root = slot == range.first && range.count > MAX_LEAF;
    if !is_root && kinds[slot] == 0u {
        return;
    }
    // A root is not among those before.
    let place = first_units[tree] + select(1u + prefixes[slot] - prefixes[range.first], 0u, is_root);
    wide_words[slot] = UNIT_QUADS / ADDRESS_QUADS * place | select(0u, ORIENTED_WORD, kinds[slot] == ORIENTED);
    wide_slots[place] = slot + 1u;
}

// choice children/kept
// The children of each wide node, which stay the same while only boxes change.

/// Eight words for each wide node, by its unit, as in `Node`; `NONE` where there is no child.
@group(0) @binding(10) var<storage, read> wide_children: array<u32>;

/// They are there already.
fn find_children(unit: u32) {
}

// choice children/found
// The children of each wide node, in the order of shared/certain: child `i` toward the corner that is high along axis `k` where bit `k` of
// `i` is set.
//
// The children are halved at the median of their centers, along the axis where these spread most first, and each half along the next axis. All is done with
// integers, so the order is the same on every device, and each child has a place of its own whatever its numbers are.
// use shared/build/wide/box

/// As above.
@group(0) @binding(10) var<storage, read_write> wide_children: array<u32>;

/// Writes the children of the wide node at a unit.
fn find_children(unit: u32) {
    let children = children_of(wide_slots[unit] - 1u);
    let places = places_of(children);
    for (var place = 0u; place < WIDTH; place++) {
        wide_children[WIDTH * unit + place] = NONE;
    }
    for (var child = 0u; child < children.n; child++) {
        wide_children[WIDTH * unit + places[child]] = children.words[child];
    }
}

/// The place of each child.
fn places_of(children: Children) -> array<u32, WIDTH> {
    var centers: array<vec3<u32>, WIDTH>;
    var least = vec3<u32>(0xffffffffu);
    var greatest = vec3<u32>(0u);
    for (var child = 0u; child < children.n; child++) {
        centers[child] = center_of(children.words[child]);
        least = min(least, centers[child]);
        greatest = max(greatest, centers[child]);
    }
    let spread = number_of(greatest) - number_of(least);
    let length = vec3<u32>(whole(spread.x), whole(spread.y), whole(spread.z));
    // The number of axes before x and before y.
    let before_x = u32(length.y > length.x) + u32(length.z > length.x);
    let before_y = u32(length.x >= length.y) + u32(length.z > length.y);
    var places: array<u32, WIDTH>;
    for (var step = 0u; step < 3u; step++) {
        let axis = select(select(2u, 1u, before_y == step), 0u, before_x == step);
        let open = places;
        for (var child = 0u; child < children.n; child++) {
            var n_together = 0u;
            var n_lower = 0u;
            for (var other = 0u; other < children.n; other++) {
                if open[other] == open[child] {
                    let a = centers[other][axis];
                    let b = centers[child][axis];
                    n_together += 1u;
                    n_lower += u32(a < b || (a == b && other < child));
                }
            }
            places[child] |= select(0u, 1u << axis, 2u * n_lower >= n_together);
        }
    }
    return places;
}

/// Twice the center of a child's box, as integers with the order of the numbers.
fn center_of(child: u32) -> vec3<u32> {
    let box = box_of(child);
    let low = bitcast<vec3<f32>>(vec3<u32>(box[0], box[1], box[2]));
    let high = bitcast<vec3<f32>>(vec3<u32>(box[3], box[4], box[5]));
    let sum = low + high;
    return vec3<u32>(whole(sum.x), whole(sum.y), whole(sum.z));
}

/// An integer with the order of the numbers. Devices may round what is below the normal numbers to zero, of either sign.
fn whole(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return ordered(select(bits, 0u, (bits & 0x7f800000u) == 0u));
}

fn number_of(keys: vec3<u32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3<u32>(unordered(keys.x), unordered(keys.y), unordered(keys.z)));
}

// part nodes
// Wide nodes that are aligned with the axes, in the layout of shared/bvh/node.
//
// # Bytes
// Twin of crates/gpu/src/trace/aligned.rs. An end of a box in steps from the start has one rounding of at most 2^-15, and so has its sum
// with `OUTWARD`, which is four times as much as both. `MOST_STEPS` leaves a step for that. What devices may flush to zero is less than
// the pads of rays.
//
// A node may hold the point of an instance that is not visible, which is beyond the coordinates that the pads of rays are for
// (shared/bvh). The ends of its other boxes are relative to the same start then, and a ray's test of them errs by at most `3 * 254 * 2^-23`
// steps: less than what is left of `OUTWARD`.
// Reads: binary tree, boxes, items, the order of wide nodes; their children, unless it finds those.
// Writes: one node for each; the children of all wide nodes, if it finds them.
// use shared/build/wide_target
// use shared/build/wide/box
// use ?children

/// The least exponent of a step, 2^-100.
const LEAST_EXPONENT: u32 = 27u;

/// So that an exponent has eight bits, and the inverse of a step is a number.
const GREATEST_EXPONENT: u32 = 253u;

/// Steps over which the boxes of a node extend at most, but for roundings.
const MOST_STEPS: f32 = 254.0;

/// By which ends are rounded outward, in steps: 2^-12.
const OUTWARD: f32 = 0.000244140625;

/// The bytes of four children, low and high ends along each axis, and of the other four.
var<private> rows: array<vec2<u32>, 6>;

/// Low and high ends.
struct Ends {
    low: vec3<f32>,
    high: vec3<f32>,
}

fn ends_of(child: u32) -> Ends {
    let box = box_of(child);
    return Ends(bitcast<vec3<f32>>(vec3<u32>(box[0], box[1], box[2])), bitcast<vec3<f32>>(vec3<u32>(box[3], box[4], box[5])));
}

/// The exponent of a step for boxes that extend over `length`: the next power of two. The difference of two zeros may be negative.
fn exponent_of(length: f32) -> u32 {
    return clamp((bitcast<u32>(abs(length) * (1.0 / MOST_STEPS)) + 0x007fffffu) >> 23u, LEAST_EXPONENT, GREATEST_EXPONENT);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let unit = slice_item(id, 64u);
    if unit >= slice.end || wide_slots[unit] == 0u {
        return;
    }
    find_children(unit);
    if !is_node(unit, false) {
        return;
    }
    let at = first_word_of(unit);
    // A node has a child.
    var start = vec3<f32>(FARTHEST);
    var end = vec3<f32>(-FARTHEST);
    var leaf_bits = 0u;
    for (var child = 0u; child < WIDTH; child++) {
        let found = wide_children[WIDTH * unit + child];
        var word = EMPTY;
        if found != NONE {
            word = word_of(found);
            let ends = ends_of(found);
            start = min(start, ends.low);
            end = max(end, ends.high);
            leaf_bits |= (word >> 31u) << child;
        }
        wide_nodes[at + child] = word;
    }
    let length = end - start;
    let exponents = vec3<u32>(exponent_of(length.x), exponent_of(length.y), exponent_of(length.z));
    let per_step = bitcast<vec3<f32>>((vec3<u32>(254u) - exponents) << vec3<u32>(23u));
    for (var row = 0u; row < 6u; row++) {
        rows[row] = vec2<u32>(0u);
    }
    for (var child = 0u; child < WIDTH; child++) {
        let found = wide_children[WIDTH * unit + child];
        // Of no child: in the wrong order.
        var low = vec3<u32>(255u);
        var high = vec3<u32>(0u);
        if found != NONE {
            let ends = ends_of(found);
            let lowest = floor((ends.low - start) * per_step - vec3<f32>(OUTWARD));
            let highest = ceil((ends.high - start) * per_step + vec3<f32>(OUTWARD));
            low = vec3<u32>(clamp(lowest, vec3<f32>(0.0), vec3<f32>(255.0)));
            high = vec3<u32>(clamp(highest, vec3<f32>(0.0), vec3<f32>(255.0)));
        }
        let half = child >> 2u;
        let shift = 8u * (child & 3u);
        for (var k = 0u; k < 3u; k++) {
            rows[2u * k][half] |= low[k] << shift;
            rows[2u * k + 1u][half] |= high[k] << shift;
        }
    }
    for (var k = 0u; k < 3u; k++) {
        wide_nodes[at + 8u + k] = bitcast<u32>(start[k]);
    }
    wide_nodes[at + 11u] = (exponents.x | (exponents.y << 8u)) | ((exponents.z << 16u) | (leaf_bits << 24u));
    for (var row = 0u; row < 4u; row++) {
        wide_nodes[at + 12u + row] = rows[row].x;
        wide_nodes[at + 16u + row] = rows[row].y;
    }
    for (var row = 4u; row < 6u; row++) {
        wide_nodes[at + 16u + row] = rows[row].x;
        wide_nodes[at + 18u + row] = rows[row].y;
    }
}

// part oriented
// Wide nodes with a frame of 32 bits for each child, in the layout of shared/bvh, `node_kinds`.
//
// # Half-extents
// The extent of the box about its center along a row of its frame is as in shared/volumes/slab. The node stores the
// coordinate of the center along the row, a dot product that errs by 3 E of its absolute terms, less than 4 E as computed; the
// half-extent grows by as much.
// Reads: binary tree, oriented boxes, triangles, the order of wide nodes and their children.
// Writes: one node for each that is oriented.
// use shared/build/wide_target
// use ?children
// use shared/frame/nearest
// use shared/volumes/frame
// use shared/volumes/slab
// use shared/volumes/item/triangles

/// Fifteen floats per inner node: center, three axes, half-extents.
@group(0) @binding(9) var<storage, read> obbs: array<f32>;

fn three_of(first: u32) -> vec3<f32> {
    return vec3<f32>(obbs[first], obbs[first + 1u], obbs[first + 2u]);
}

/// A box around a child.
fn oriented_box_of(child: u32) -> Box {
    if (child & LEAF) == 0u {
        let at = 15u * child;
        let frame = mat3x3<f32>(three_of(at + 3u), three_of(at + 6u), three_of(at + 9u));
        return Box(three_of(at), frame, three_of(at + 12u));
    }
    let item = leaves[child & ~LEAF];
    let content = item_content(item);
    let size = length_1(content.columns[1] - content.columns[0]) + length_1(content.columns[2] - content.columns[0]);
    if size > 1e-30 {
        let box = enclosed(triangle_axes(content.columns, size), content, content);
        // A rejected frame gives negative half-extents.
        if all(box.half_extents >= vec3(0.0)) {
            return box;
        }
    }
    let columns = content.columns;
    return box_from_aabb(min(min(columns[0], columns[1]), columns[2]), max(max(columns[0], columns[1]), columns[2]));
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let unit = slice_item(id, 64u);
    if unit >= slice.end || !is_node(unit, true) {
        return;
    }
    let at = first_word_of(unit);
    for (var child = 0u; child < WIDTH; child++) {
        let found = wide_children[WIDTH * unit + child];
        if found == NONE {
            put_nothing(at + child);
            continue;
        }
        let box = oriented_box_of(found);
        let frame = nearest_frame(box.frame);
        var rows = rows_of_frame(frame);
        for (var k = 0u; k < 3u; k++) {
            let row = rows[k];
            let half = extent_along(row, box.frame, box.half_extents) + 4.0 * ROUNDING * dot(abs(row), abs(box.center));
            wide_nodes[at + 16u * k + 16u + child] = bitcast<u32>(dot(row, box.center));
            wide_nodes[at + 16u * k + 24u + child] = bitcast<u32>(half * (1.0 + 2.0 * ROUNDING));
        }
        wide_nodes[at + child] = word_of(found);
        wide_nodes[at + 8u + child] = frame;
    }
}

/// An empty slot.
fn put_nothing(at: u32) {
    for (var k = 0u; k < 3u; k++) {
        wide_nodes[at + 16u * k + 16u] = 0u;
        wide_nodes[at + 16u * k + 24u] = MINUS_NOWHERE;
    }
    wide_nodes[at] = EMPTY;
    wide_nodes[at + 8u] = 0u;
}

// part triangles
// Triangles of wide BVHs, in the layout of shared/triangle/records.
// Reads: items.
// Writes: vertices and number of the triangle of each leaf position.
// Holds: coordinates are copies, but for triangles without area, which nothing hits. A leaf names the position of its first triangle.
// use shared/build/slice
// use shared/build/tree/forest
// use shared/exact/flat

@group(0) @binding(3) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read_write> wide_triangles: array<vec4<u32>>;
/// Nine words per triangle.
@group(1) @binding(0) var<storage, read> corners: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let position = slice_item(id, 64u);
    if position >= slice.end {
        return;
    }
    let item = leaves[position];
    var words: array<u32, 9>;
    for (var row = 0u; row < 9u; row++) {
        words[row] = corners[9u * item + row];
    }
    words = flat_as_edge(words);
    let number = item - ranges[tree_of(item)].first;
    wide_triangles[3u * position] = vec4<u32>(words[0], words[1], words[2], number);
    wide_triangles[3u * position + 1u] = vec4<u32>(words[3], words[4], words[5], 0u);
    wide_triangles[3u * position + 2u] = vec4<u32>(words[6], words[7], words[8], 0u);
}
