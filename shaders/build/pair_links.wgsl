// Links from each binary node to its parent, for traversal without a stack.
// Reads: pairs. A child has `QUADS` quads; its word ends `WORD_QUAD`, as in shared/binary/volume.
// Writes: one word per node: the parent's number times two, plus 1 for its right child, plus 1. Roots keep 0.
// use shared/build/slice
// const WORD_QUAD
// const QUADS

@group(0) @binding(1) var<storage, read> pairs: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> pair_links: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let node = slice_item(id, 64u);
    if node >= slice.end {
        return;
    }
    for (var side = 0u; side < 2u; side++) {
        let word = pairs[QUADS * (2u * node + side) + WORD_QUAD].w;
        // Leaves have the highest bit. Node 0 is a root, so a word of 0 belongs to an empty slot.
        if word != 0u && (word >> 31u) == 0u {
            pair_links[word] = 2u * node + side + 1u;
        }
    }
}
