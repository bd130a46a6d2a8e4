// Where a ray enters the volume of a binary node's child.
// use shared/bvh

/// Entry of a volume that the ray does not enter.
const OUTSIDE: f32 = -1.0;

// choice aabb
// Axis-aligned boxes: lower ends and the child's word, upper ends.

const CHILD_QUADS: u32 = 2u;

/// The word of the child that starts at a quad.
fn word_at(at: u32) -> u32 {
    return nodes[at].w;
}

/// Scaled `t` where the ray enters the child that starts at a quad, or `OUTSIDE`.
fn entry_of(at: u32, t_max: f32) -> f32 {
    let low = bitcast<vec3<f32>>(nodes[at].xyz);
    let high = bitcast<vec3<f32>>(nodes[at + 1u].xyz);
    let backward = space.recip < vec3<f32>(0.0);
    let near = select(low, high, backward) * space.recip - space.near;
    let far = select(high, low, backward) * space.recip - space.far;
    let first = max(max(near.x, near.y), max(near.z, space.t_min));
    let last = min(min(far.x, far.y), min(far.z, t_max));
    return select(OUTSIDE, first, first <= last);
}

// choice obb
// Oriented boxes as slabs: for each axis its components and the half-extent, then the center and the child's word.

const CHILD_QUADS: u32 = 4u;

/// The word of the child that starts at a quad.
fn word_at(at: u32) -> u32 {
    return nodes[at + 3u].w;
}

/// Scaled `t` where the ray enters the child that starts at a quad, or `OUTSIDE`.
///
/// The rounding is that of oriented wide nodes (shared/bvh): four for `axis * (o - c)`, three for `axis * d`, and the same quotient
/// and products. A center lies within three times the reach of the vertices, because each slab touches them: the host
/// multiplies the reach by three.
fn entry_of(at: u32, t_max: f32) -> f32 {
    let from_center = space.origin - bitcast<vec3<f32>>(nodes[at + 3u].xyz);
    var first = space.t_min;
    var last = t_max;
    for (var k = 0u; k < 3u; k++) {
        let slab = bitcast<vec4<f32>>(nodes[at + k]);
        let p = project(slab.xyz, from_center);
        let d = project(slab.xyz, space.direction);
        let half = slab.w + space.oriented_pad;
        let a = 1.0 / max(abs(d), MIN_DIRECTION);
        let center = select(p, -p, d < 0.0) * a;
        first = max(-(half * a) - center, first);
        last = min(half * a - center, last);
    }
    return select(OUTSIDE, first, first <= last);
}
