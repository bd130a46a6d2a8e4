// Where a ray enters the volume of a binary node's child.
// use shared/bvh

/// Entry of a volume that the ray does not enter.
const OUTSIDE: f32 = -1.0;

// part entry
// Entries from the spans of `?volume`.
// use ?volume

/// Scaled `t` where the ray enters the child that starts at a quad, or `OUTSIDE`.
fn entry_of(at: u32, t_max: f32) -> f32 {
    let span = span_of(at);
    return select(OUTSIDE, span.x, span.x <= min(span.y, t_max));
}

// choice aabb
// Axis-aligned boxes: lower ends and the child's word, upper ends.

const CHILD_QUADS: u32 = 2u;

/// The word of the child that starts at a quad.
fn word_at(at: u32) -> u32 {
    return nodes[at].w;
}

/// Scaled `t` where the ray enters and leaves the child that starts at a quad.
fn span_of(at: u32) -> vec2<f32> {
    let low = bitcast<vec3<f32>>(nodes[at].xyz);
    let high = bitcast<vec3<f32>>(nodes[at + 1u].xyz);
    let backward = space.recip < vec3<f32>(0.0);
    let near = select(low, high, backward) * space.recip - space.near;
    let far = select(high, low, backward) * space.recip - space.far;
    return vec2<f32>(max(max(near.x, near.y), max(near.z, space.t_min)), min(min(far.x, far.y), far.z));
}

// choice obb
// Oriented boxes as slabs: for each axis its components and the half-extent, then the center and the child's word.

const CHILD_QUADS: u32 = 4u;

/// The word of the child that starts at a quad.
fn word_at(at: u32) -> u32 {
    return nodes[at + 3u].w;
}

/// Scaled `t` where the ray enters and leaves the child that starts at a quad.
///
/// The rounding is that of oriented wide nodes (shared/bvh): four for `axis * (o - c)`, three for `axis * d`, and the same quotient
/// and products. A center lies within three times the reach of the vertices, because each slab touches them: the host
/// multiplies the reach by three.
fn span_of(at: u32) -> vec2<f32> {
    let from_center = space.origin - bitcast<vec3<f32>>(nodes[at + 3u].xyz);
    var first = space.t_min;
    var last = FAR;
    for (var k = 0u; k < 3u; k++) {
        let slab = bitcast<vec4<f32>>(nodes[at + k]);
        let p = project(slab.xyz, from_center);
        let d = project(slab.xyz, space.direction);
        let half = slab.w + space.oriented_pad;
        let a = reciprocal(d);
        let center = p * a;
        let extent = half * abs(a);
        first = max(-extent - center, first);
        last = min(extent - center, last);
    }
    return vec2<f32>(first, last);
}
