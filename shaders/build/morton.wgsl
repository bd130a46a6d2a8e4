// Morton codes of items in the grid of their tree.

// part bounds
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

// part domain
// Domain, second dispatch: one invocation per tree.
// Reads: bounding boxes.
// Writes: the grid on which the items of a tree get their Morton codes.
// use shared/build/slice
// use build/morton/grid

@group(0) @binding(2) var<storage, read_write> domains: array<Domain>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let tree = slice_item(id, 64u);
    // A tree without items has no box.
    if tree < slice.end && bounds[6u * tree] != 0u {
        domains[tree] = grid_of(tree);
    }
}

// part grid
// The grid on which the items of a tree get their Morton codes, from its bounding box.
// Holds: the same bits as on the CPU. A WGSL division may err by 2.5 ULP, so the one division that decides cells uses integers.
// Source: Lauterbach et al. 2009. The scale comes from the largest extent; it is 0 where that is zero or the scale is not
// finite.
// use ?item
// use ?code
// use shared/build/code
// use shared/build/slice

@group(0) @binding(6) var<storage, read> bounds: array<u32>;

fn end_at(tree: u32, k: u32) -> f32 {
    return bitcast<f32>(end_of(bounds[6u * tree + k], k));
}

fn grid_of(tree: u32) -> Domain {
    let low = vec3<f32>(end_at(tree, 0u), end_at(tree, 1u), end_at(tree, 2u));
    let high = vec3<f32>(end_at(tree, 3u), end_at(tree, 4u), end_at(tree, 5u));
    let extent = high - low;
    let largest = max(max(extent.x, extent.y), extent.z);
    // Not fused with a sum of the item in the same kernel: codes are those of the rounded product.
    return Domain(stored(N_POINTS * low), cells_over(N_POINTS * largest));
}

/// 2^CELL_BITS / x, rounded to nearest; 0 if x is 0 or the result is not finite.
///
/// With x = m·2^(e − 150), where m has 24 bits, the quotient is 2^47 / m times a power of two. Its 24 or 25 bits are computed
/// one at a time. The results for our grids are far from subnormal.
fn cells_over(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = bits >> 23u;
    // Zero, values so small that the scale overflows, and infinity.
    if exponent == 0u || exponent >= 255u {
        return 0.0;
    }
    let divisor = (bits & 0x7fffffu) | 0x800000u;
    var remainder = 0x800000u;
    var quotient = 0u;
    for (var bit = 0u; bit < 25u; bit++) {
        quotient <<= 1u;
        if remainder >= divisor {
            remainder -= divisor;
            quotient += 1u;
        }
        remainder <<= 1u;
    }
    // The remainder is already doubled. There are no ties: the only odd divisor of a power of two is one.
    if remainder > divisor {
        quotient += 1u;
    }
    var power = CELL_BITS + 253u - exponent;
    if quotient == 0x1000000u {
        quotient = 0x800000u;
        power += 1u;
    }
    if power >= 255u {
        return 0.0;
    }
    return bitcast<f32>((power << 23u) | (quotient & 0x7fffffu));
}

// choice grids/given
// Grids that a dispatch computed.
// use shared/build/code

@group(0) @binding(6) var<storage, read> domains: array<Domain>;

fn grid_at(tree: u32) -> Domain {
    return domains[tree];
}

// choice grids/found
// Grids that each item computes, which takes less time than a dispatch.
// use build/morton/grid

fn grid_at(tree: u32) -> Domain {
    return grid_of(tree);
}

// part codes
// Morton codes.
// Reads: grids or bounding boxes, items.
// Writes: one code per item, in input order; where there are several trees, the tree of each item, which is the most significant word of
// its key; where several tiles are sorted, the counts of the first digit.
// Holds: the same integers as on the CPU. Sums have a fixed order; a subtraction followed by a product cannot be fused, and the offset is stored before it.
// Source: Lauterbach et al. 2009.
// use shared/build/slice
// use shared/build/tree/forest
// use ?item
// use ?code
// use shared/build/code
// use shared/build/digit/counts
// use ?grids

@group(0) @binding(5) var<storage, read_write> tree_indices: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let item = slice_item(id, 64u);
    if item >= slice.end {
        return;
    }
    let tree = tree_of(item);
    if arrayLength(&ranges) > 1u {
        tree_indices[item] = tree;
    }
    let domain = grid_at(tree);
    let last = f32((1u << CELL_BITS) - 1u);
    let cells = (item_sum(item) - domain.offset) * domain.scale;
    write_code(item, vec3<u32>(clamp(cells, vec3(0.0), vec3(last))));
    if digit.n_tiles > 1u {
        add_keys(digit.first_count, digit_of(codes_low[item]), item / TILE, 1u);
    }
}
