// Items that are boxes, by the axis-aligned boxes around them.
// use shared/build/ordered

/// Points whose sum codes an item.
const N_POINTS: f32 = 2.0;

/// Bits of the ends, three low ones and three high ones a box.
@group(1) @binding(0) var<storage, read> item_aabbs: array<u32>;

fn ends(item: u32, side: u32) -> vec3<u32> {
    let at = 6u * item + 3u * side;
    return vec3<u32>(item_aabbs[at], item_aabbs[at + 1u], item_aabbs[at + 2u]);
}

fn item_sum(item: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(ends(item, 0u)) + bitcast<vec3<f32>>(ends(item, 1u));
}

fn item_reach(item: u32) -> Reach {
    let low = ends(item, 0u);
    let high = ends(item, 1u);
    return Reach(reach_of(low.x, low.y, low.z).low, reach_of(high.x, high.y, high.z).high);
}
