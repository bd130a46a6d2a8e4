// Domain, second dispatch: an invocation for each tree.
// Reads: boxes. Writes: the grid of cells on which a tree's items are coded.
// Holds: the same bits as on the CPU. WGSL lets a division err by 2.5 units in the last place, so the one division that
// decides cells is done in integers.
// Source: Lauterbach et al. 2009; scale by the largest extent, 0 where that is zero or the scale not finite.
// use shared/build/slice
// use ?item
// use ?code
// use shared/code

@group(0) @binding(1) var<storage, read> bounds: array<u32>;
@group(0) @binding(2) var<storage, read_write> domains: array<Domain>;

fn end_at(tree: u32, k: u32) -> f32 {
    return bitcast<f32>(end_of(bounds[6u * tree + k], k));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let tree = slice_item(group, groups, 64u, local);
    // What has no item has no box.
    if tree >= slice.end || bounds[6u * tree] == 0u {
        return;
    }
    let low = vec3<f32>(end_at(tree, 0u), end_at(tree, 1u), end_at(tree, 2u));
    let high = vec3<f32>(end_at(tree, 3u), end_at(tree, 4u), end_at(tree, 5u));
    let extent = high - low;
    let largest = max(max(extent.x, extent.y), extent.z);
    domains[tree] = Domain(N_POINTS * low, cells_over(N_POINTS * largest));
}

/// 2^CELL_BITS / x, rounded to nearest; 0 where that is not finite or x is.
///
/// With x = m·2^(e − 150) and m of 24 bits the quotient is 2^47 / m, whose 24 or 25 bits come one by one, times a power of two.
/// The results of the grids we use are far from the least floats.
fn cells_over(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = bits >> 23u;
    // Zero and what is so small that the scale overflows; infinity.
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
    // The remainder is doubled already. There are no ties: no odd number but one divides a power of two.
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
