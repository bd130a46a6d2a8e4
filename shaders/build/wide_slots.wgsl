// The order of wide nodes in memory: roots first, then by the slots of their binary nodes.
// Reads: sizes of wide nodes, their prefix sums.
// Writes: the binary node of each unit of memory, plus one.
// use shared/build/slice

@group(0) @binding(1) var<storage, read> units: array<u32>;
@group(0) @binding(2) var<storage, read> prefixes: array<u32>;
@group(0) @binding(3) var<storage, read_write> wide_slots: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot < slice.end && units[slot] != 0u {
        wide_slots[prefixes[slot]] = slot + 1u;
    }
}
