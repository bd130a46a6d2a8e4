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
