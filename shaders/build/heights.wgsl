// Tree heights, bottom-up.
// Reads: parents.
// Writes: the height of each inner node in nodes, including the leaf, and the maximum over all nodes.
// Holds: the atomic word that identifies the second child also carries the height, so no other memory must be visible with it.
// 0 means that no child has arrived.
// use shared/build/slice
// use shared/build/tree

@group(0) @binding(1) var<storage, read> parents: array<u32>;
@group(0) @binding(2) var<storage, read_write> heights: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> depth: atomic<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let leaf = slice_item(id, 64u);
    if leaf >= slice.end {
        return;
    }
    var height = 1u;
    var node = parents[arrayLength(&parents) / 2u + leaf];
    while node != NONE {
        let sibling = atomicExchange(&heights[node], height);
        if sibling == 0u {
            return;
        }
        height = 1u + max(height, sibling);
        atomicStore(&heights[node], height);
        node = parents[node];
    }
    atomicMax(&depth, height);
}
