// Domain, first dispatch.
// Reads: items.
// Writes: the bounding box of each tree's items, as ordered integers.
// Holds: the maximum of integers does not depend on the order of atomics.
// use shared/build/slice
// use shared/build/tree/forest
// use ?item

/// Items per invocation. More items per invocation reduce contention on the words of a tree.
const ITEMS_EACH: u32 = 8u;

@group(0) @binding(1) var<storage, read_write> bounds: array<atomic<u32>>;

var<workgroup> group_bounds: array<atomic<u32>, 6>;

fn grow(tree: u32, reach: Reach) {
    for (var k = 0u; k < 6u; k++) {
        atomicMax(&bounds[6u * tree + k], reach_at(reach, k));
    }
}

/// A slice counts tiles, one per work-group.
@compute @workgroup_size(64)
fn main(id: Invocation) {
    let tile = slice.first + group_index(id);
    let first = tile * 64u * ITEMS_EACH;
    let last_range = ranges[arrayLength(&ranges) - 1u];
    let end = min(last_range.first + last_range.count, first + 64u * ITEMS_EACH);
    let group_tree = tree_of(first);
    var tree = group_tree;
    var reach = Reach();
    for (var item = first + id.local; item < end; item += 64u) {
        let next_tree = tree_of(item);
        if next_tree != tree {
            grow(tree, reach);
            tree = next_tree;
            reach = Reach();
        }
        reach = joined(reach, item_reach(item));
    }
    if tree != group_tree {
        grow(tree, reach);
    } else {
        for (var k = 0u; k < 6u; k++) {
            atomicMax(&group_bounds[k], reach_at(reach, k));
        }
    }
    workgroupBarrier();
    if id.local < 6u {
        atomicMax(&bounds[6u * group_tree + id.local], atomicLoad(&group_bounds[id.local]));
    }
}
