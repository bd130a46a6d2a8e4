// Inner nodes and references to what is below and above them.
//
// A tree over the items from `first` on has its nodes in the slots from `first` on, the root first, and its last slot empty. A
// left child is numbered by its last leaf, a right child by its first (Karras 2012).

const LEAF: u32 = 0x80000000u;
const NONE: u32 = 0xffffffffu;

struct Node {
    /// Children: slots of inner nodes, or positions of leaves with the highest bit set.
    left: u32,
    right: u32,
    /// First and last leaf below.
    first: u32,
    last: u32,
}

// part forest
// The trees of a level, built together: each over a range of the level's items.

struct Range {
    first: u32,
    count: u32,
}

@group(3) @binding(0) var<storage, read> ranges: array<Range>;

/// The tree that an item belongs to: the last whose range begins at the item or before it.
fn tree_of(item: u32) -> u32 {
    var low = 0u;
    var high = arrayLength(&ranges);
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if ranges[middle].first <= item {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}
