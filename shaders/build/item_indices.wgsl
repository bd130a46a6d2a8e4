// Sort, before the first digit.
// Writes: the item indices in input order.
// use shared/build/slice

@group(0) @binding(1) var<storage, read_write> items: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i < slice.end {
        items[i] = i;
    }
}
