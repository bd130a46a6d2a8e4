// What the kernels that build trees and wide nodes share.

// part slice
// The range of items that one dispatch processes. Slicing bounds the time of a dispatch.
// use shared/invocation/index

struct Slice {
    first: u32,
    end: u32,
    /// Always zero, unknown to the compiler.
    zero: u32,
}

@group(0) @binding(0) var<uniform> slice: Slice;

/// The item of an invocation. Items at or beyond `slice.end` do not exist.
fn slice_item(id: Invocation, size: u32) -> u32 {
    return slice.first + invocation(id, size);
}

/// The value as it is stored. Compilers may simplify `(a + b) - a` to `b`, but not through an unknown integer.
fn stored(v: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(v) ^ vec3(slice.zero));
}

// part pass
// The size of a dispatch that the one before it finds: items, and a work-group for each.

/// Before the dispatch.
struct PassSize {
    groups_x: u32,
    groups_y: u32,
    groups_z: u32,
    n: u32,
    depth: u32,
}

/// While it is found.
struct NextPass {
    groups_x: atomic<u32>,
    groups_y: atomic<u32>,
    groups_z: u32,
    n: atomic<u32>,
    /// Levels so far.
    depth: atomic<u32>,
}

/// Work-groups along one axis, at most.
const MOST_GROUPS: u32 = 65535u;

/// Rows of work-groups for `n` of them. Both numbers grow with `n`.
fn rows_of(n: u32) -> vec2<u32> {
    return vec2<u32>(min(n, MOST_GROUPS), (n + MOST_GROUPS - 1u) / MOST_GROUPS);
}

// part tree
// Inner nodes and references to their children and parents.
//
// A tree over the items that start at `first` uses the slots that start at `first`: the root first, the last slot unused. A
// left child has the number of its last leaf, a right child that of its first (Karras 2012).

const LEAF: u32 = 0x80000000u;
const NONE: u32 = 0xffffffffu;

/// More nodes than there are between a leaf and its root. It ends loops over parents that are not written, because a program did not
/// submit what it recorded.
const MAX_HEIGHT: u32 = 128u;

struct Node {
    /// Children: slots of inner nodes, or positions of leaves with the highest bit set.
    left: u32,
    right: u32,
    /// First and last leaf below.
    first: u32,
    last: u32,
}

// part tree/forest
// The trees of a level, built together. Each covers a range of the level's items.

struct Range {
    first: u32,
    count: u32,
}

@group(3) @binding(0) var<storage, read> ranges: array<Range>;

/// The tree of an item: the last one whose range starts at or before the item.
fn tree_of(item: u32) -> u32 {
    var low = 0u;
    var high = arrayLength(&ranges);
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if ranges[middle].first <= item {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// part climb
// Bottom-up maximum of six numbers per node, each propagated separately.
// Holds: the atomic word that identifies the second child also carries the number, so no other memory must be visible with it.
// 0 means that no child has arrived; no number maps to 0.
// Source: after Karras 2012, whose counter gives no guarantee about other memory.
// use shared/build/tree
// use shared/build/ordered

/// Parents of inner nodes by slot, followed by parents of leaves by position.
@group(0) @binding(6) var<storage, read> parents: array<u32>;
/// Six words per inner node: the number of the first child until the second arrives, then the bits of the three minima and
/// three maxima.
@group(0) @binding(3) var<storage, read_write> ends: array<atomic<u32>>;

fn parent_of_leaf(leaf: u32) -> u32 {
    return parents[arrayLength(&parents) / 2u + leaf];
}

/// Propagates the bounds of a child of `parent` upwards.
fn climb(parent: u32, own: Reach) {
    var reach = array<u32, 6>(own.low.x, own.low.y, own.low.z, own.high.x, own.high.y, own.high.z);
    var climbing = 63u;
    var node = parent;
    for (var step = 0u; step < MAX_HEIGHT && node != NONE && climbing != 0u; step++) {
        for (var k = 0u; k < 6u; k++) {
            if (climbing & (1u << k)) == 0u {
                continue;
            }
            let sibling = atomicExchange(&ends[6u * node + k], reach[k]);
            if sibling == 0u {
                climbing &= ~(1u << k);
            } else {
                reach[k] = max(reach[k], sibling);
                atomicStore(&ends[6u * node + k], end_of(reach[k], k));
            }
        }
        node = parents[node];
    }
}

// part ordered
// Floats as integers, compared and copied exactly, even where a device flushes subnormals or ignores the sign of zero.

/// An unsigned integer with the order of the floats. It is never zero for a number, so zero is below all.
fn ordered(bits: u32) -> u32 {
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

/// Inverse of `ordered`.
fn unordered(key: u32) -> u32 {
    return select(~key, key & 0x7fffffffu, (key & 0x80000000u) != 0u);
}

/// Three minima and three maxima of a box as integers that grow with the box, from the bits of the floats.
struct Reach {
    low: vec3<u32>,
    high: vec3<u32>,
}

fn reach_of(x: u32, y: u32, z: u32) -> Reach {
    let key = vec3<u32>(ordered(x), ordered(y), ordered(z));
    return Reach(~key, key);
}

fn joined(a: Reach, b: Reach) -> Reach {
    return Reach(max(a.low, b.low), max(a.high, b.high));
}

/// One of the six numbers.
fn reach_at(reach: Reach, k: u32) -> u32 {
    return select(reach.high[k % 3u], reach.low[k], k < 3u);
}

/// The float bits of one of the six numbers.
fn end_of(key: u32, k: u32) -> u32 {
    return unordered(select(key, ~key, k < 3u));
}

// part root
// The axis-aligned box of a tree's root.
// use shared/build/ordered
// use shared/build/tree/forest
// use ?item

@group(0) @binding(1) var<storage, read> aabbs: array<u32>;

struct RootBox {
    low: vec3<f32>,
    high: vec3<f32>,
    is_empty: bool,
}

/// The box of a tree, which is its item where there is only one.
fn root_of(tree: u32) -> RootBox {
    let range = ranges[tree];
    var low = vec3<u32>(0u);
    var high = vec3<u32>(0u);
    if range.count == 1u {
        let reach = item_reach(range.first);
        low = vec3<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u));
        high = vec3<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u));
    } else if range.count > 1u {
        let at = 6u * range.first;
        low = vec3<u32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
        high = vec3<u32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    }
    return RootBox(bitcast<vec3<f32>>(low), bitcast<vec3<f32>>(high), range.count == 0u);
}

// part surface
// Surface areas that round alike on all devices.
// use shared/build/slice

/// Half the surface area of a box. Products are stored, so that no compiler fuses them with the sum.
fn half_area_of(low: vec3<f32>, high: vec3<f32>) -> f32 {
    let size = high - low;
    let products = stored(vec3<f32>((size.x + size.z) * size.y, size.z * size.x, 0.0));
    return products.x + products.y;
}

// part length
// Lengths of vectors whose squares overflow or underflow.

/// The length of a vector; 0 if all components are subnormal.
fn length_of(v: vec3<f32>) -> f32 {
    let greatest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if greatest < 1.2e-38 {
        return 0.0;
    }
    return greatest * length(v / greatest);
}

// part digit
// A digit of the radix sort, and the tiles of keys that work-groups process.
// use shared/build/slice
// const GROUP
// const KEYS_EACH
// const RADIX

const TILE: u32 = GROUP * KEYS_EACH;

struct Digit {
    n_keys: u32,
    n_tiles: u32,
    /// Lowest bit of the digit.
    shift: u32,
    /// First word of this digit in `counts`.
    first_count: u32,
    /// Blocks of tiles that have counts of their own; 0 where there are few tiles.
    n_blocks: u32,
    /// Which digit comes next: none, one of the same word, the lowest of the next word.
    next: u32,
}

@group(0) @binding(1) var<uniform> digit: Digit;

/// The digit of a key.
fn digit_of(key: u32) -> u32 {
    return (key >> digit.shift) & (RADIX - 1u);
}

/// Tile of a work-group. Tiles at or beyond `slice.end` do not exist.
fn tile_of(id: Invocation) -> u32 {
    return slice.first + group_index(id);
}

// part digit/counts
// The number of keys with each value of a digit, in each block of tiles and in each tile.
// use shared/build/digit

/// For each digit and each of its values a word for each block, then one for each tile.
@group(0) @binding(7) var<storage, read_write> counts: array<atomic<u32>>;

/// Tiles of a block.
const BLOCK: u32 = 32u;

const NEXT_OF_WORD: u32 = 1u;
const NEXT_WORD: u32 = 2u;

/// The first word of a value in those of the digit that starts at `first`.
fn row_of(first: u32, value: u32) -> u32 {
    return first + value * (digit.n_blocks + digit.n_tiles);
}

/// Adds keys of a tile.
fn add_keys(first: u32, value: u32, tile: u32, n: u32) {
    let row = row_of(first, value);
    atomicAdd(&counts[row + digit.n_blocks + tile], n);
    if digit.n_blocks > 0u {
        atomicAdd(&counts[row + tile / BLOCK], n);
    }
}

// part scan
// Prefix sums over the invocations of a work-group.

var<workgroup> partial_sums: array<u32, GROUP>;

struct Scanned {
    /// Sum of the values of the invocations before this one.
    before: u32,
    total: u32,
}

/// Sums one value per invocation. Requires uniform control flow. Source: Hillis and Steele 1986.
fn scan_group(local: u32, value: u32) -> Scanned {
    partial_sums[local] = value;
    workgroupBarrier();
    for (var reach = 1u; reach < GROUP; reach <<= 1u) {
        var before = 0u;
        if local >= reach {
            before = partial_sums[local - reach];
        }
        workgroupBarrier();
        partial_sums[local] += before;
        workgroupBarrier();
    }
    let scanned = Scanned(partial_sums[local] - value, partial_sums[GROUP - 1u]);
    // The caller may reuse the memory at once.
    workgroupBarrier();
    return scanned;
}

// part ploc
// Clusters of leaves along the Morton curve, which are merged pair by pair into a tree.
//
// # The same tree as on the CPU
// A cluster's partner is the one within the radius whose union with it has the least area; of
// equals the one whose position differs in lower bits. Clusters that are each other's partner are merged, at the position of the
// first. Areas round alike on all devices, so partners are those of `canted_sah`'s `ploc`.
//
// A cluster has the number of its first leaf. A merged cluster keeps the first number; the second becomes that of the new node.
// So nodes have different numbers without a counter.
// Source: Meister and Bittner 2018.
// use shared/build/slice
// use shared/build/tree
// use shared/build/surface

struct Cluster {
    low: vec3<f32>,
    /// The first leaf.
    number: u32,
    high: vec3<f32>,
    /// The subtree: a node's number, or the position of a leaf with the highest bit.
    word: u32,
}

/// The clusters of a tree.
struct TreeState {
    first: u32,
    end: u32,
    /// Whether all neighbors are merged next, because few partners were found.
    is_forced: u32,
}

struct Iteration {
    number: u32,
    /// Clusters on each side that are compared.
    radius: u32,
    /// Iterations with `NEAR_RADIUS` instead.
    n_near: u32,
    /// Items of all trees.
    n_items: u32,
    /// Iterations that have dispatches of their own.
    n_recorded: u32,
    /// Blocks of tiles before the first iteration.
    n_blocks: u32,
}

/// A node before it is renumbered.
struct Merge {
    left: u32,
    right: u32,
    /// Leaves below the left child, and below both.
    n_left: u32,
    n: u32,
}

const NEAR_RADIUS: u32 = 2u;

/// An iteration that merges fewer than one in this many clusters is slow, unless there are at most `FEW`.
const SLOW: u32 = 16u;
const FEW: u32 = 128u;

/// A measure for pairs of clusters: less is nearer.
struct Nearness {
    area: f32,
    /// In which bits the positions differ.
    difference: u32,
}

const NOT_NEAR = Nearness(3.0e38, 0xffffffffu);

/// The area of the union of two clusters.
fn union_area(a: Cluster, b: Cluster) -> f32 {
    return half_area_of(min(a.low, b.low), max(a.high, b.high));
}

/// The nearer one.
fn nearer(a: Nearness, b: Nearness) -> Nearness {
    if b.area < a.area || (b.area == a.area && b.difference < a.difference) {
        return b;
    }
    return a;
}

fn radius_of(iteration: Iteration) -> u32 {
    return select(iteration.radius, min(iteration.radius, NEAR_RADIUS), iteration.number < iteration.n_near);
}

/// Whether to merge all neighbors after an iteration.
fn is_forced_after(before: u32, after: u32, was_forced: bool) -> bool {
    let n_merged = before - after;
    return n_merged == 0u || (!was_forced && before > FEW && n_merged < before / SLOW);
}

// part ploc/states
// The clusters of each tree, and how many there are before each iteration.
// use shared/build/tree/forest

/// Four words for each tree: its clusters as in `TreeState`, and its merged pairs of this iteration. Then the number of iterations so far,
/// the number of clusters before each iteration and after the last, and for each iteration the number of kept clusters of each block of
/// tiles.
@group(0) @binding(3) var<storage, read_write> states: array<atomic<u32>>;

/// Tiles of a block.
const BLOCK: u32 = 64u;

fn state_of(tree: u32) -> TreeState {
    return TreeState(atomicLoad(&states[4u * tree]), atomicLoad(&states[4u * tree + 1u]), atomicLoad(&states[4u * tree + 2u]));
}

/// Also ends the count of merged pairs.
fn put_state(tree: u32, state: TreeState) {
    atomicStore(&states[4u * tree], state.first);
    atomicStore(&states[4u * tree + 1u], state.end);
    atomicStore(&states[4u * tree + 2u], state.is_forced);
    atomicStore(&states[merged_at(tree)], 0u);
}

fn merged_at(tree: u32) -> u32 {
    return 4u * tree + 3u;
}

fn done_at() -> u32 {
    return 4u * arrayLength(&ranges);
}

fn remaining_at(iteration: Iteration) -> u32 {
    return done_at() + 1u + iteration.number;
}

fn block_at(iteration: Iteration, block: u32) -> u32 {
    return done_at() + 2u + iteration.n_recorded + iteration.number * iteration.n_blocks + block;
}

// part ploc/scratch
// What an iteration finds for each cluster: its partner and what follows. Then the number of kept clusters of each tile.

/// Most clusters on each side that are compared.
const REACH: u32 = 14u;

/// A partner, whether both are merged, and whether the cluster is the first of its tree. Clusters take 32 bytes, and buffers less than
/// 2^32, so a position has fewer than 30 bits.
const PARTNER: u32 = 0x3fffffffu;
const IS_MERGED: u32 = 0x80000000u;
const IS_FIRST: u32 = 0x40000000u;

/// Clusters of a tree that a work-group merges alone.
const FEW_CLUSTERS: u32 = 256u;

// part ploc/nodes
// Nodes of merged pairs.

@group(0) @binding(6) var<storage, read_write> merges: array<Merge>;
/// Nodes by number, then leaves by position: the parent's number times two, plus 1 for a right child.
@group(0) @binding(7) var<storage, read_write> links: array<u32>;

/// The leaves below a cluster.
fn n_below(word: u32) -> u32 {
    if (word & LEAF) != 0u {
        return 1u;
    }
    return merges[word].n;
}

fn put_link(word: u32, link: u32) {
    let n = arrayLength(&links) / 2u;
    links[select(word, n + (word & ~LEAF), (word & LEAF) != 0u)] = link;
}

/// The cluster of a merged pair with so many leaves below each, whose node is written.
fn merged(a: Cluster, b: Cluster, n_left: u32, n_right: u32) -> Cluster {
    merges[b.number] = Merge(a.word, b.word, n_left, n_left + n_right);
    put_link(a.word, 2u * b.number);
    put_link(b.word, 2u * b.number + 1u);
    return Cluster(min(a.low, b.low), a.number, max(a.high, b.high), b.number);
}

// part wide
// Which subtrees of a binary tree become the children of a wide node.
//
// The child with the largest box is replaced by its two children until there are eight, or only leaves. A subtree of at most
// `MAX_LEAF` items is a leaf.
// Holds: areas round alike, so that the choice is the same on every device.
// Source: Wald, Benthin and Boulos 2008.
// use shared/build/slice
// use shared/build/tree
// use shared/build/surface
// const MAX_LEAF

const WIDTH: u32 = 8u;

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
/// The box of each inner node: three minima, three maxima.
@group(0) @binding(2) var<storage, read> aabbs: array<f32>;

/// Children as in `Node`.
struct Children {
    words: array<u32, WIDTH>,
    n: u32,
}

/// Whether a child is a leaf of the wide BVH.
fn is_leaf(child: u32) -> bool {
    if (child & LEAF) != 0u {
        return true;
    }
    return nodes[child].last - nodes[child].first < MAX_LEAF;
}

/// Half the surface area of a child's box; negative for a leaf.
fn area_to_open(child: u32) -> f32 {
    if is_leaf(child) {
        return -1.0;
    }
    let at = 6u * child;
    return half_area_of(vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]), vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]));
}

/// The children of the wide node over inner node `slot`.
fn children_of(slot: u32) -> Children {
    var children: Children;
    var areas: array<f32, WIDTH>;
    children.words[0] = nodes[slot].left;
    children.words[1] = nodes[slot].right;
    areas[0] = area_to_open(children.words[0]);
    areas[1] = area_to_open(children.words[1]);
    children.n = 2u;
    while children.n < WIDTH {
        var largest = 0u;
        for (var child = 1u; child < children.n; child++) {
            largest = select(largest, child, areas[child] > areas[largest]);
        }
        if areas[largest] < 0.0 {
            break;
        }
        let opened = nodes[children.words[largest]];
        children.words[largest] = opened.left;
        areas[largest] = area_to_open(opened.left);
        children.words[children.n] = opened.right;
        areas[children.n] = area_to_open(opened.right);
        children.n += 1u;
    }
    return children;
}

// part wide/leaves
// The items of leaves.

@group(0) @binding(3) var<storage, read> leaves: array<u32>;

// part wide/box
// Boxes of children.
// use shared/build/wide/leaves
// use shared/build/ordered
// use ?item

/// The bits of three minima and three maxima of a child's box.
fn box_of(child: u32) -> array<u32, 6> {
    if (child & LEAF) != 0u {
        let reach = item_reach(leaves[child & ~LEAF]);
        return array<u32, 6>(
            end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u),
            end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u),
        );
    }
    var box: array<u32, 6>;
    for (var k = 0u; k < 6u; k++) {
        box[k] = bitcast<u32>(aabbs[6u * child + k]);
    }
    return box;
}

// part wide_target
// Where wide nodes are written.
// use shared/build/wide/leaves
// use shared/build/wide_word
// const UNIT_QUADS

struct Level {
    /// The first quad of this level.
    first_quad: u32,
    /// Whether a leaf holds one item of the top level.
    is_top: u32,
}

/// The word of each wide node by slot.
@group(0) @binding(4) var<storage, read> wide_words: array<u32>;
/// The slot of each wide node by its unit, plus one.
@group(0) @binding(6) var<storage, read> wide_slots: array<u32>;
@group(0) @binding(7) var<uniform> target_level: Level;
@group(0) @binding(8) var<storage, read_write> wide_nodes: array<u32>;

/// A word that refers to nothing.
const EMPTY: u32 = 0x7fffffffu;

/// 2^63, beyond all coordinates, and the bits of its negative: for a box that no ray enters.
const FARTHEST: f32 = 9223372036854775808.0;
const MINUS_NOWHERE: u32 = 0xdf000000u;

/// The first word of a unit of memory, which is a node.
fn first_word_of(unit: u32) -> u32 {
    return 4u * (target_level.first_quad + UNIT_QUADS * unit);
}

/// Whether a wide node of a kind starts at a unit. Roots are aligned.
fn is_node(unit: u32, is_oriented: bool) -> bool {
    let slot = wide_slots[unit];
    return slot != 0u && ((wide_words[slot - 1u] & ORIENTED_WORD) != 0u) == is_oriented;
}

fn word_of(child: u32) -> u32 {
    if !is_leaf(child) {
        return wide_words[child];
    }
    if (child & LEAF) != 0u {
        let position = child & ~LEAF;
        return LEAF | select(position, leaves[position], target_level.is_top != 0u);
    }
    let node = nodes[child];
    let n = node.last - node.first + 1u;
    return LEAF | ((n - 1u) << 26u) | node.first;
}

// part wide_word
// Kinds of wide nodes, and their words: the address, and the kind. As in shared/bvh.

const ALIGNED: u32 = 1u;
const ORIENTED: u32 = 2u;

/// Quads of the unit of node addresses.
const ADDRESS_QUADS: u32 = 2u;

/// Bits of a word for the kind of an oriented node.
const ORIENTED_WORD: u32 = 0x20000000u;

// part code
// Morton codes and the grid of cells that they number.

/// Moves bit i of 10 to bit 3i, halving the runs at each step.
fn spread(cells: vec3<u32>) -> vec3<u32> {
    var x = (cells | (cells << vec3(16u))) & vec3(0x030000ffu);
    x = (x | (x << vec3(8u))) & vec3(0x0300f00fu);
    x = (x | (x << vec3(4u))) & vec3(0x030c30c3u);
    return (x | (x << vec3(2u))) & vec3(0x09249249u);
}

/// Interleaves three cells, x in the highest bit of each triple.
fn interleaved(cells: vec3<u32>) -> u32 {
    let bits = spread(cells);
    return (bits.x << 2u) | (bits.y << 1u) | bits.z;
}


struct Domain {
    /// Minimum coordinates, times the number of points summed per item.
    offset: vec3<f32>,
    /// Cells per unit of that sum; 0 if the items have no finite extent.
    scale: f32,
}

// choice code/narrow
// 30-bit codes in one word.

const CELL_BITS: u32 = 10u;

@group(2) @binding(0) var<storage, read_write> codes_low: array<u32>;
@group(2) @binding(1) var<storage, read> sorted_low: array<u32>;

fn write_code(item: u32, cells: vec3<u32>) {
    codes_low[item] = interleaved(cells);
}

/// Length of the common prefix of two codes; 32 if they are equal.
fn common_bits(a: u32, b: u32) -> u32 {
    return countLeadingZeros(sorted_low[a] ^ sorted_low[b]);
}

/// Result of `common_bits` for equal codes.
const CODE_BITS: u32 = 32u;

// choice code/wide
// 63-bit codes in two words.

const CELL_BITS: u32 = 21u;

@group(2) @binding(0) var<storage, read_write> codes_low: array<u32>;
@group(2) @binding(1) var<storage, read> sorted_low: array<u32>;
@group(2) @binding(2) var<storage, read_write> codes_high: array<u32>;
@group(2) @binding(3) var<storage, read> sorted_high: array<u32>;

/// Ten bits per axis give 30 bits of the code, the next ten another 30, and the last bit of each axis three more.
fn write_code(item: u32, cells: vec3<u32>) {
    let lowest = interleaved(cells & vec3(0x3ffu));
    let middle = interleaved((cells >> vec3(10u)) & vec3(0x3ffu));
    let highest = interleaved(cells >> vec3(20u));
    codes_low[item] = lowest | (middle << 30u);
    codes_high[item] = (middle >> 2u) | (highest << 28u);
}

/// Length of the common prefix of two codes; 64 if they are equal.
fn common_bits(a: u32, b: u32) -> u32 {
    let high = sorted_high[a] ^ sorted_high[b];
    if high != 0u {
        return countLeadingZeros(high);
    }
    return 32u + countLeadingZeros(sorted_low[a] ^ sorted_low[b]);
}

/// Result of `common_bits` for equal codes.
const CODE_BITS: u32 = 64u;

// part pair
// The volumes of a traversed node.
// use shared/volumes/enclosure
// use ?item

// choice pair/aabb
// Axis-aligned boxes: lower ends and the child's word, upper ends. Numbers are copied as integers.
// use shared/build/ordered

const CHILD_QUADS: u32 = 2u;

@group(0) @binding(3) var<storage, read> aabbs: array<u32>;

fn put_node(at: u32, word: u32, slot: u32) {
    let first = 6u * slot;
    pairs[at] = vec4<u32>(aabbs[first], aabbs[first + 1u], aabbs[first + 2u], word);
    pairs[at + 1u] = vec4<u32>(aabbs[first + 3u], aabbs[first + 4u], aabbs[first + 5u], 0u);
}

fn put_item(at: u32, word: u32, item: u32) {
    let reach = item_reach(item);
    pairs[at] = vec4<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u), word);
    pairs[at + 1u] = vec4<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u), 0u);
}

// choice pair/obb
// Oriented boxes as slabs: for each axis its components and the half-extent, then the center and the child's word.
// use shared/volumes/slab
// use shared/build/ordered

const CHILD_QUADS: u32 = 4u;

/// Fifteen floats each: center, three axes, half-extents.
@group(0) @binding(3) var<storage, read> obbs: array<f32>;

fn three_of(first: u32) -> vec3<f32> {
    return vec3<f32>(obbs[first], obbs[first + 1u], obbs[first + 2u]);
}

fn put_node(at: u32, word: u32, slot: u32) {
    let first = 15u * slot;
    let columns = mat3x3<f32>(three_of(first + 3u), three_of(first + 6u), three_of(first + 9u));
    put_slabs(at, word, three_of(first), columns, three_of(first + 12u));
}

fn put_item(at: u32, word: u32, item: u32) {
    let content = item_content(item);
    if content.is_box {
        put_slabs(at, word, content.center, content.columns, content.half_extents);
        return;
    }
    let reach = item_reach(item);
    let low = vec3<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u));
    let high = vec3<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u));
    let box = box_from_aabb(bitcast<vec3<f32>>(low), bitcast<vec3<f32>>(high));
    put_slabs(at, word, box.center, box.frame, box.half_extents);
}

fn put_slabs(at: u32, word: u32, center: vec3<f32>, columns: mat3x3<f32>, half_extents: vec3<f32>) {
    for (var k = 0u; k < 3u; k++) {
        pairs[at + k] = bitcast<vec4<u32>>(slab_of(columns, half_extents, k));
    }
    pairs[at + 3u] = vec4<u32>(bitcast<vec3<u32>>(center), word);
}
