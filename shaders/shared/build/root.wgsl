// The axis-aligned box of a tree's root.
// use shared/build/ordered
// use shared/build/tree/forest
// use ?item

@group(0) @binding(1) var<storage, read> aabbs: array<u32>;

struct RootBox {
    low: vec3<f32>,
    high: vec3<f32>,
    is_empty: bool,
}

/// The box of a tree, which is its item where there is only one.
fn root_of(tree: u32) -> RootBox {
    let range = ranges[tree];
    var low = vec3<u32>(0u);
    var high = vec3<u32>(0u);
    if range.count == 1u {
        let reach = item_reach(range.first);
        low = vec3<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u));
        high = vec3<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u));
    } else if range.count > 1u {
        let at = 6u * range.first;
        low = vec3<u32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
        high = vec3<u32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    }
    return RootBox(bitcast<vec3<f32>>(low), bitcast<vec3<f32>>(high), range.count == 0u);
}
