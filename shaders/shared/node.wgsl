// Which of a node's eight children a ray enters, and in which order.
//
// Children are tested four at once: `half` is 0 or 1. A test gives keys: where the ray enters, by the bits of its `t`, whose
// last three make way for the child's number; so order of keys is order of entries. The lost bits make entries earlier.
// use shared/tree

/// Bit of words that name leaves.
const LEAF: u32 = 0x80000000u;

/// A word that names nothing.
const EMPTY: u32 = 0x7fffffffu;

/// The key of a child that the ray does not enter.
const MISSED: u32 = 0xffffffffu;

/// Quads of words of a cache line, which nodes are counted in.
const LINE_QUADS: u32 = 4u;

/// First quad of a node.
fn quads_of(word: u32) -> u32 {
    return space.first_node + (word & 0x1fffffffu) * LINE_QUADS;
}

/// Keys of four children of a node.
fn enter(word: u32, half: u32, t_max: f32) -> vec4<u32> {
    let at = quads_of(word) + half;
    switch word >> 29u {
        case 0u: {
            return enter_box(at, half, t_max);
        }
        case 1u: {
            return enter_shared(at, half, t_max);
        }
        default: {
            return enter_lean(at, half, t_max);
        }
    }
}

/// The word of a child.
fn child_word(word: u32, child: u32) -> u32 {
    var row = 30u;
    switch word >> 29u {
        case 0u: {
            row = 12u;
        }
        case 1u: {
            row = 16u;
        }
        default: {}
    }
    return nodes[quads_of(word) + row + (child >> 2u)][child & 3u];
}

fn quad(at: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(nodes[at]);
}

/// Rows lo x, hi x, lo y, hi y, lo z, hi z in the mesh's frame.
fn enter_box(at: u32, half: u32, t_max: f32) -> vec4<u32> {
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

/// Nine numbers of one frame, padding to two rows, then as a box node in that frame.
fn enter_shared(at: u32, half: u32, t_max: f32) -> vec4<u32> {
    let first = quad(at - half);
    let second = quad(at - half + 1u);
    let third = quad(at - half + 2u);
    var near = vec4<f32>(space.t_min);
    var far = vec4<f32>(t_max);
    for (var k = 0u; k < 3u; k += 1u) {
        var row = first.xyz;
        if k == 1u {
            row = vec3<f32>(first.w, second.x, second.y);
        } else if k == 2u {
            row = vec3<f32>(second.z, second.w, third.x);
        }
        let origin = project(row, space.origin);
        let recip = reciprocal(project(row, space.direction));
        let lo = (quad(at + 4u + 4u * k) - vec4<f32>(origin + space.pad_lean)) * recip;
        let hi = (quad(at + 6u + 4u * k) - vec4<f32>(origin - space.pad_lean)) * recip;
        near = max(min(lo, hi), near);
        far = min(max(lo, hi), far);
    }
    return keys(near, far, half);
}

/// For each axis three components of the children's rows, centres, half-extents.
fn enter_lean(at: u32, half: u32, t_max: f32) -> vec4<u32> {
    var near = vec4<f32>(space.t_min);
    var far = vec4<f32>(t_max);
    for (var k = 0u; k < 3u; k += 1u) {
        let q = at + 10u * k;
        let x = quad(q);
        let y = quad(q + 2u);
        let z = quad(q + 4u);
        let p = x * space.origin.x + (y * space.origin.y + (z * space.origin.z - quad(q + 6u)));
        let d = x * space.direction.x + (y * space.direction.y + z * space.direction.z);
        let h = quad(q + 8u) + vec4<f32>(space.pad_lean);
        let a = guarded_reciprocals(d);
        let middle = select(p, -p, d < vec4<f32>(0.0)) * a;
        near = max(-(h * a) - middle, near);
        far = min(h * a - middle, far);
    }
    return keys(near, far, half);
}

/// `1/|d|`, bounded.
fn guarded_reciprocals(d: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(1.0) / max(abs(d), vec4<f32>(LEAST_DIRECTION));
}

fn keys(near: vec4<f32>, far: vec4<f32>, half: u32) -> vec4<u32> {
    let child = vec4<u32>(0u, 1u, 2u, 3u) + vec4<u32>(4u * half);
    // No entry is negative but for the sign of a zero.
    let key = (bitcast<vec4<u32>>(abs(near)) & vec4<u32>(~7u)) | child;
    return select(vec4<u32>(MISSED), key, near <= far);
}

/// Children that a ray enters: their numbers, the nearest in the lowest three bits, and from bit 24 on how many they are.
///
/// Six rounds of four comparisons: Batcher's bitonic sorter (1968). Even and odd places lie in two vectors.
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
