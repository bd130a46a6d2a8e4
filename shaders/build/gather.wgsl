// Sort, between two words of the key.
// Reads: words by item, items in order.
// Writes: the word of each item, in that order.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<u32>;
@group(0) @binding(3) var<storage, read_write> gathered: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i < slice.end {
        gathered[i] = words[items[i]];
    }
}
