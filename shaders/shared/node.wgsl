// Box tests: which of a node's eight children a ray enters, and in which order.
//
// Children are tested four at a time; `half` is 0 or 1. A test returns keys: the bits of the entry `t`, whose last three bits
// are replaced by the index of the child. Sorting keys sorts by entry. The lost bits only make entries earlier.
// use shared/bvh
// use ?node_kinds

/// Key of a child that the ray does not enter.
const MISSED: u32 = 0xffffffffu;

/// Quads per cache line, the unit of node addresses, as a power of two.
const LINE_QUADS_LOG2: u32 = 2u;

/// First quad of a node.
fn quads_of(word: u32) -> u32 {
    return space.first_node + ((word & 0x1fffffffu) << LINE_QUADS_LOG2);
}

fn quad(at: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(nodes[at]);
}

/// Rows lo x, hi x, lo y, hi y, lo z, hi z in the mesh frame.
fn enter_aligned(at: u32, half: u32, t_max: f32) -> vec4<u32> {
    let q = vec3<u32>(at) + space.near_quads;
    let p = vec3<u32>(at) + (space.near_quads ^ vec3<u32>(2u));
    let near_x = quad(q.x) * space.recip.x - vec4<f32>(space.near.x);
    let near_y = quad(q.y) * space.recip.y - vec4<f32>(space.near.y);
    let near_z = quad(q.z) * space.recip.z - vec4<f32>(space.near.z);
    let far_x = quad(p.x) * space.recip.x - vec4<f32>(space.far.x);
    let far_y = quad(p.y) * space.recip.y - vec4<f32>(space.far.y);
    let far_z = quad(p.z) * space.recip.z - vec4<f32>(space.far.z);
    let near = max(max(near_x, near_y), max(near_z, vec4<f32>(space.t_min)));
    let far = min(min(far_x, far_y), min(far_z, vec4<f32>(t_max)));
    return keys(near, far, half);
}

fn keys(near: vec4<f32>, far: vec4<f32>, half: u32) -> vec4<u32> {
    let child = vec4<u32>(0u, 1u, 2u, 3u) + vec4<u32>(4u * half);
    // Entries are not negative, except for a negative zero.
    let key = (bitcast<vec4<u32>>(abs(near)) & vec4<u32>(~7u)) | child;
    return select(vec4<u32>(MISSED), key, near <= far);
}

/// Indices of the entered children, three bits each with the nearest lowest, and their number from bit 24.
///
/// Six rounds of four comparisons: Batcher's bitonic sorter (1968). Two vectors hold the even and odd positions.
fn ordered(a: vec4<u32>, b: vec4<u32>) -> u32 {
    let is_missed = vec4<u32>(MISSED);
    let entered = select(vec4<u32>(0u), vec4<u32>(1u), a != is_missed) + select(vec4<u32>(0u), vec4<u32>(1u), b != is_missed);
    let n = (entered.x + entered.y) + (entered.z + entered.w);
    var lo = min(a, b);
    var hi = max(a, b);
    var p = vec4<u32>(lo.x, hi.x, lo.z, hi.z);
    var q = vec4<u32>(hi.y, lo.y, hi.w, lo.w);
    lo = min(p, q);
    hi = max(p, q);
    p = vec4<u32>(lo.x, hi.y, lo.z, hi.w);
    q = vec4<u32>(lo.y, hi.x, lo.w, hi.z);
    lo = min(p, q);
    hi = max(p, q);
    p = vec4<u32>(lo.x, hi.x, lo.y, hi.y);
    q = vec4<u32>(hi.w, lo.w, hi.z, lo.z);
    lo = min(p, q);
    hi = max(p, q);
    p = vec4<u32>(lo.x, lo.y, hi.w, hi.z);
    q = vec4<u32>(lo.z, lo.w, hi.y, hi.x);
    lo = min(p, q);
    hi = max(p, q);
    p = vec4<u32>(lo.x, hi.x, lo.z, hi.z);
    q = vec4<u32>(lo.y, hi.y, lo.w, hi.w);
    lo = min(p, q) & vec4<u32>(7u);
    hi = max(p, q) & vec4<u32>(7u);
    let even = lo.x | (lo.y << 6u) | (lo.z << 12u) | (lo.w << 18u);
    let odd = hi.x | (hi.y << 6u) | (hi.z << 12u) | (hi.w << 18u);
    return even | (odd << 3u) | (n << 24u);
}
