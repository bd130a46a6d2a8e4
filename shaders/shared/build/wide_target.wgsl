// Where wide nodes are written.
// use shared/build/wide
// use shared/build/leaf

struct Level {
    /// The first unit of memory of this level.
    first_unit: u32,
    /// Whether a leaf holds one item of the top level.
    is_top: u32,
}

@group(0) @binding(3) var<storage, read> leaves: array<u32>;
/// Units of memory of each wide node by slot, except for roots, and its first unit.
@group(0) @binding(4) var<storage, read> units: array<u32>;
@group(0) @binding(5) var<storage, read> places: array<u32>;
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

/// Words of a unit, and its cache lines.
const UNIT_WORDS: u32 = 64u;
const UNIT_LINES: u32 = 4u;

/// Bits of a word for the kind of an oriented node.
const ORIENTED_WORD: u32 = 0x20000000u;

/// The binary node of the wide node that starts at a unit, or `NONE`. Roots are aligned.
fn slot_of(unit: u32) -> u32 {
    // Zero less one is `NONE`.
    return wide_slots[unit] - 1u;
}

fn word_of(child: u32) -> u32 {
    if !is_leaf(child) {
        return UNIT_LINES * places[child] | select(0u, ORIENTED_WORD, units[child] == 2u);
    }
    if (child & LEAF) != 0u {
        let position = child & ~LEAF;
        return LEAF | select(position, leaves[position], target_level.is_top != 0u);
    }
    let node = nodes[child];
    let n = node.last - node.first + 1u;
    return LEAF | ((n - 1u) << 26u) | part_of_leaf(node.first, n);
}
