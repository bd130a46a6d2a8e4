// Where the triangles of a leaf are stored: from the position of its first triangle, so that leaves need no counter.
//
// Half of a block of four is a part. A leaf of one or two triangles takes the part of its first position, a larger one starts
// with the first whole block at or after it: three triangles have at least as many positions as they need parts from there.

/// The part that the leaf of `n` triangles from position `first` starts with.
fn part_of_leaf(first: u32, n: u32) -> u32 {
    return select(first + (first & 1u), first, n <= 2u);
}
