// Where wide nodes are written.
// use shared/build/wide
// use shared/build/wide_word
// use shared/build/leaf

struct Level {
    /// The first unit of memory of this level.
    first_unit: u32,
    /// Whether a leaf holds one item of the top level.
    is_top: u32,
}

@group(0) @binding(3) var<storage, read> leaves: array<u32>;
/// The word of each wide node by slot.
@group(0) @binding(4) var<storage, read> wide_words: array<u32>;
/// The slot of each wide node by its first unit, plus one.
@group(0) @binding(6) var<storage, read> wide_slots: array<u32>;
@group(0) @binding(7) var<uniform> target_level: Level;
@group(0) @binding(8) var<storage, read_write> wide_nodes: array<u32>;
/// From build/wide_children.
@group(0) @binding(10) var<storage, read> wide_children: array<u32>;

/// A word that refers to nothing.
const EMPTY: u32 = 0x7fffffffu;

/// The bits of 2^63, beyond all coordinates, and of its negative: for a box that no ray enters.
const NOWHERE: u32 = 0x5f000000u;
const MINUS_NOWHERE: u32 = 0xdf000000u;

/// Words of a unit.
const UNIT_WORDS: u32 = 64u;

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
    return LEAF | ((n - 1u) << 26u) | part_of_leaf(node.first, n);
}
