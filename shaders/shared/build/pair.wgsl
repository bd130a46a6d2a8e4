// The volumes of a traversed node.
// use shared/build/enclosure
// use ?item

// choice aabb
// Axis-aligned boxes: lower ends and the child's word, upper ends. Numbers are copied as integers.
// use shared/build/ordered

const CHILD_QUADS: u32 = 2u;

@group(0) @binding(3) var<storage, read> aabbs: array<u32>;

fn put_node(at: u32, word: u32, slot: u32) {
    let first = 6u * slot;
    pairs[at] = vec4<u32>(aabbs[first], aabbs[first + 1u], aabbs[first + 2u], word);
    pairs[at + 1u] = vec4<u32>(aabbs[first + 3u], aabbs[first + 4u], aabbs[first + 5u], 0u);
}

fn put_item(at: u32, word: u32, item: u32) {
    let reach = item_reach(item);
    pairs[at] = vec4<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u), word);
    pairs[at + 1u] = vec4<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u), 0u);
}

// choice obb
// Oriented boxes as slabs: for each axis its components and the half-extent, then the center and the child's word.
// use shared/build/slab
// use shared/build/ordered

const CHILD_QUADS: u32 = 4u;

/// Fifteen floats each: center, three axes, half-extents.
@group(0) @binding(3) var<storage, read> obbs: array<f32>;

fn three_of(first: u32) -> vec3<f32> {
    return vec3<f32>(obbs[first], obbs[first + 1u], obbs[first + 2u]);
}

fn put_node(at: u32, word: u32, slot: u32) {
    let first = 15u * slot;
    let columns = mat3x3<f32>(three_of(first + 3u), three_of(first + 6u), three_of(first + 9u));
    put_slabs(at, word, three_of(first), columns, three_of(first + 12u));
}

fn put_item(at: u32, word: u32, item: u32) {
    let content = item_content(item);
    if content.is_box {
        put_slabs(at, word, content.center, content.columns, content.half_extents);
        return;
    }
    let reach = item_reach(item);
    let low = vec3<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u));
    let high = vec3<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u));
    let box = box_from_aabb(bitcast<vec3<f32>>(low), bitcast<vec3<f32>>(high));
    put_slabs(at, word, box.center, box.frame, box.half_extents);
}

fn put_slabs(at: u32, word: u32, center: vec3<f32>, columns: mat3x3<f32>, half_extents: vec3<f32>) {
    for (var k = 0u; k < 3u; k++) {
        pairs[at + k] = bitcast<vec4<u32>>(slab_of(columns, half_extents, k));
    }
    pairs[at + 3u] = vec4<u32>(bitcast<vec3<u32>>(center), word);
}
