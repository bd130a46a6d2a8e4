// Sort, only where there are several trees.
// Writes: the tree of each item, which is the most significant word of its key.
// use shared/build/slice
// use shared/build/tree/forest

@group(0) @binding(1) var<storage, read_write> tree_indices: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let item = slice_item(id, 64u);
    if item < slice.end {
        tree_indices[item] = tree_of(item);
    }
}
