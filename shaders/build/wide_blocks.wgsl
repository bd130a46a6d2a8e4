// Triangle blocks of wide BVHs, in the layout of shared/triangle/blocks.
// Reads: binary tree, items.
// Writes: coordinates and number of the triangle of each leaf position.
// Holds: coordinates are copies, but for triangles without area, which nothing hits. A leaf is the largest subtree of at most `MAX_LEAF` triangles.
// use shared/build/slice
// use shared/build/tree
// use shared/build/tree/forest
// use shared/build/leaf
// use shared/exact/flat
// const MAX_LEAF

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> parents: array<u32>;
@group(0) @binding(3) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read_write> wide_blocks: array<u32>;
/// Nine words per triangle.
@group(1) @binding(0) var<storage, read> corners: array<u32>;

/// Words of four triangles.
const HALF_WORDS: u32 = 40u;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let position = slice_item(id, 64u);
    if position >= slice.end {
        return;
    }
    var first = position;
    var n = 1u;
    var parent = parents[arrayLength(&parents) / 2u + position];
    for (var step = 0u; step < MAX_HEIGHT && parent != NONE; step++) {
        let node = nodes[parent];
        if node.last - node.first >= MAX_LEAF {
            break;
        }
        first = node.first;
        n = node.last - node.first + 1u;
        parent = parents[parent];
    }
    let part = part_of_leaf(first, n);
    let i = position - first;
    var at = HALF_WORDS * (part / 2u) + 2u * (part & 1u);
    // Blocks of eight, then one of four.
    let is_four = (i & ~7u) + 4u >= n;
    let stride = select(8u, 4u, is_four);
    at += select((i / 8u) * 2u * HALF_WORDS + (i & 7u), (i / 4u) * HALF_WORDS + (i & 3u), is_four);
    let item = leaves[position];
    var words: array<u32, 9>;
    for (var row = 0u; row < 9u; row++) {
        words[row] = corners[9u * item + row];
    }
    words = flat_as_edge(words);
    for (var row = 0u; row < 9u; row++) {
        wide_blocks[at + row * stride] = words[row];
    }
    wide_blocks[at + 9u * stride] = item - ranges[tree_of(item)].first;
}
