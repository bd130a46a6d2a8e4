// The order of wide nodes in memory: each tree has room of its own, in which the root comes first, then all others by the slots of
// their binary nodes.
// Reads: sizes of wide nodes, their prefix sums, the first unit of each tree.
// Writes: the word of each wide node by slot; the slot of each wide node by its first unit, plus one.
// use shared/build/slice
// use shared/build/wide_word
// use shared/build/tree/forest
// const MAX_LEAF

@group(0) @binding(1) var<storage, read> units: array<u32>;
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
    if !is_root && units[slot] == 0u {
        return;
    }
    // A root has no size of its own.
    let place = first_units[tree] + select(1u + prefixes[slot] - prefixes[range.first], 0u, is_root);
    wide_words[slot] = UNIT_LINES * place | select(0u, ORIENTED_WORD, units[slot] == ORIENTED);
    wide_slots[place] = slot + 1u;
}
