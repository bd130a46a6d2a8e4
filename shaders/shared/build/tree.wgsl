// Inner nodes and references to their children and parents.
//
// A tree over the items that start at `first` uses the slots that start at `first`: the root first, the last slot unused. A
// left child has the number of its last leaf, a right child that of its first (Karras 2012).

const LEAF: u32 = 0x80000000u;
const NONE: u32 = 0xffffffffu;

/// More nodes than there are between a leaf and its root. It ends loops over parents that are not written, because a program did not
/// submit what it recorded.
const MAX_HEIGHT: u32 = 128u;

struct Node {
    /// Children: slots of inner nodes, or positions of leaves with the highest bit set.
    left: u32,
    right: u32,
    /// First and last leaf below.
    first: u32,
    last: u32,
}

// part forest
// The trees of a level, built together. Each covers a range of the level's items.

struct Range {
    first: u32,
    count: u32,
}

@group(3) @binding(0) var<storage, read> ranges: array<Range>;

/// The tree of an item: the last one whose range starts at or before the item.
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
