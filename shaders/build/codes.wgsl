// Morton codes.
// Reads: grids, items.
// Writes: one code per item, in input order.
// Holds: the same integers as on the CPU. Sums have a fixed order; a subtraction followed by a product cannot be fused.
// Source: Lauterbach et al. 2009.
// use shared/build/slice
// use shared/build/tree/forest
// use ?item
// use ?code
// use shared/build/code

@group(0) @binding(1) var<storage, read> domains: array<Domain>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let item = slice_item(id, 64u);
    if item >= slice.end {
        return;
    }
    let domain = domains[tree_of(item)];
    let last = f32((1u << CELL_BITS) - 1u);
    let cells = (item_sum(item) - domain.offset) * domain.scale;
    write_code(item, vec3<u32>(clamp(cells, vec3(0.0), vec3(last))));
}
