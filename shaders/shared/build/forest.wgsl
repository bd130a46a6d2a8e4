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
