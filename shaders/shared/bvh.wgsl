// Eight-wide BVHs in the CPU's layout, and the ray in the space of one BVH.
//
// # No lost hit
// Every hit of the CPU's loop over all triangles is found here too, assuming no more than WGSL promises. Let E = 2^-23: `+ - *`
// have a relative error below E in any rounding mode, quotients 2.5 E; `a * b + c` may round once or twice; a result that
// underflows may become zero. `S = |o| + reach`, the largest coordinates of the origin and of any vertex.
//
// A triangle test may report a `t` whose point lies within `e` of its triangle in each coordinate: 64 E of S (derived in
// shared/triangle) plus the error of the instance's transform (shared/level/instances). The ray is thickened by `e` and by the
// rounding of the box test, following the proof in `canted_wide`'s traversal with other constants:
//
// * Axis-aligned boxes in the mesh frame: a plane is at `start + step * byte`, and is intersected at
//   `byte * (step * r) + (start * r - (o + pad) * r)`. `step` is a power of two, so `step * r` is exact. The boxes of a node extend over at
//   most 2.1 S (build/wide/nodes says what holds where they extend farther). The shifted origin, three products and the inner difference,
//   and for `t * d` the quotient and the sum: E (1 + 1 + 1 + 2.1 + 1 + 3.5) = 9.6 E of S.
// * Rotated mesh frame: origin and direction have three terms each with at most three roundings per term, along a row whose
//   absolute components sum to at most sqrt(3). Together with the above: sqrt(3) (6 + 9.6) E of S.
// * A frame per child: four roundings in `row * o - c`, three in `row * d`, then the product `q * a`, the padded half-extent,
//   its product, and 3.5 for `t * d'`: sqrt(3) (7 + 1 + 1 + 1 + 3.5) E of S.
//
// An additional 1 to 1.5 E covers second-order terms and the rounding of the pads. `TINY` covers underflow for scenes between
// 2^-50 and 2^60 in size.
// use shared/ray

/// Bit of words that refer to leaves.
const LEAF: u32 = 0x80000000u;

/// A word that refers to nothing.
const EMPTY: u32 = 0x7fffffffu;

/// Upper bound of one relative rounding: 2^-23.
const ROUNDING: f32 = 1.1920929e-7;

/// Added to every pad: more than underflow can lose.
const TINY: f32 = 1e-36;

/// Square root of three, rounded up.
const ROOT_3: f32 = 1.7320509;

/// Rounding of a box test relative to S: axis-aligned, in a rotated frame, in a child's own frame.
const ALIGNED_ROUNDING: f32 = 11.0 * ROUNDING;
const ROTATED_ROUNDING: f32 = 17.0 * ROUNDING;
const ORIENTED_ROUNDING: f32 = 15.0 * ROUNDING;

/// Smallest absolute component of a direction in a box test, 2^-64.
const MIN_DIRECTION: f32 = 5.421010862427522e-20;

/// Header of a BVH in `nodes` and `leaf_triangles`.
struct Bvh {
    /// Rows of the frame of the aligned nodes. The fourth components are: the largest coordinate of any vertex,
    row_x: vec4<f32>,
    /// the error of hits relative to the largest coordinate of the origin,
    row_y: vec4<f32>,
    /// and the constant part of that error.
    row_z: vec4<f32>,
    /// Root word, first node and first triangle in quads, and whether the frame is rotated.
    words: vec4<u32>,
}

@group(0) @binding(0) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read> leaf_triangles: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> bvhs: array<Bvh>;

/// The ray prepared for a BVH. `t` is scaled so that the largest component of the direction is in [1, 2).
struct Space {
    origin: vec3<f32>,
    direction: vec3<f32>,
    t_min: f32,
    /// Scaled `t` per caller's `t`, a power of two, and its reciprocal.
    to_scaled: f32,
    from_scaled: f32,
    /// For aligned nodes: reciprocals of the direction, offsets of the near and far planes.
    recip: vec3<f32>,
    near: vec3<f32>,
    far: vec3<f32>,
    oriented_pad: f32,
    /// Deviation from the CPU's ray in sheared coordinates: per distance, and constant.
    drift: vec2<f32>,
    first_node: u32,
    first_triangle: u32,
    instance: u32,
}

var<private> space: Space;

/// Largest absolute component.
fn greatest(v: vec3<f32>) -> f32 {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

/// `1/d`, bounded.
fn reciprocal(d: f32) -> f32 {
    return select(1.0, -1.0, d < 0.0) / max(abs(d), MIN_DIRECTION);
}

/// Transforms the ray into the space of a BVH. `drift` is in units of that space; its second component is for a direction of
/// any length. Returns the root of the BVH, or `EMPTY` if the direction is effectively zero.
fn enter_bvh(index: u32, origin: vec3<f32>, direction: vec3<f32>, t_min: f32, drift: vec2<f32>, instance: u32) -> u32 {
    let bvh = bvhs[index];
    // The power of two at or below the largest component. Its reciprocal must not underflow.
    let power = min(bitcast<u32>(greatest(direction)) & 0x7f800000u, 0x7e800000u);
    if power == 0u {
        return EMPTY;
    }
    space.to_scaled = bitcast<f32>(power);
    space.from_scaled = bitcast<f32>(0x7f000000u - power);
    space.origin = origin;
    space.direction = direction * space.from_scaled;
    space.t_min = scaled_t(t_min);
    space.drift = vec2<f32>(drift.x, drift.y * space.from_scaled);
    space.first_node = bvh.words.y;
    space.first_triangle = bvh.words.z;
    space.instance = instance;
    thicken(bvh);
    return bvh.words.x;
}

/// Prepares the ray for box tests: in the frame of the mesh, with pads.
fn thicken(bvh: Bvh) {
    let far_off = greatest(space.origin);
    let scale = far_off + bvh.row_x.w;
    let error = hit_error(bvh, far_off, scale);
    // The error lengthens the distance to the hit.
    let size = scale + error;
    space.oriented_pad = ROOT_3 * (error + ORIENTED_ROUNDING * size) + TINY;
    var pad = error + ALIGNED_ROUNDING * size + TINY;
    var origin = space.origin;
    var direction = space.direction;
    if bvh.words.w != 0u {
        pad = ROOT_3 * (error + ROTATED_ROUNDING * size) + TINY;
        origin = rotated(bvh, origin);
        direction = rotated(bvh, direction);
    }
    space.recip = vec3<f32>(reciprocal(direction.x), reciprocal(direction.y), reciprocal(direction.z));
    let backward = space.recip < vec3<f32>(0.0);
    let toward = select(vec3<f32>(pad), vec3<f32>(-pad), backward);
    space.near = (origin + toward) * space.recip;
    space.far = (origin - toward) * space.recip;
}

/// Largest distance of a hit from its triangle, in each coordinate, for a ray whose origin is at `far_off`; `scale` includes the reach.
fn hit_error(bvh: Bvh, far_off: f32, scale: f32) -> f32 {
    return (bvh.row_y.w * far_off + bvh.row_z.w) + 2.0 * (space.drift.y * scale + space.drift.x);
}

fn rotated(bvh: Bvh, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(project(bvh.row_x.xyz, v), project(bvh.row_y.xyz, v), project(bvh.row_z.xyz, v));
}

fn project(row: vec3<f32>, v: vec3<f32>) -> f32 {
    return (row.x * v.x + row.y * v.y) + row.z * v.z;
}

/// Scaled `t` from the caller's `t`; never infinite.
fn scaled_t(t: f32) -> f32 {
    if space.to_scaled > 1.0 && t >= FAR * space.from_scaled {
        return FAR;
    }
    return t * space.to_scaled;
}

/// The caller's `t` from a scaled one; never infinite.
fn caller_t(t: f32) -> f32 {
    if space.from_scaled > 1.0 && t >= FAR * space.to_scaled {
        return FAR;
    }
    return t * space.from_scaled;
}

// part node
// Box tests: which of a node's eight children a ray enters, and in which order.
//
// Children are tested four at a time; `half` is 0 or 1. A test returns keys: the bits of the entry `t`, whose last three bits
// are replaced by the index of the child. Sorting keys sorts by entry. The lost bits only make entries earlier.
// use shared/bvh
// use ?node_kinds

/// Key of a child that the ray does not enter.
const MISSED: u32 = 0xffffffffu;

/// Quads of the unit of node addresses, 32 bytes, as a power of two.
const ADDRESS_QUADS_LOG2: u32 = 1u;

/// First quad of a node.
fn quads_of(word: u32) -> u32 {
    return space.first_node + ((word & 0x1fffffffu) << ADDRESS_QUADS_LOG2);
}

fn quad(at: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(nodes[at]);
}

/// The word of a child.
fn child_word(word: u32, child: u32) -> u32 {
    return nodes[quads_of(word) + (child >> 2u)][child & 3u];
}

/// Scaled `t` where the ray enters and leaves four boxes.
struct Spans {
    near: vec4<f32>,
    far: vec4<f32>,
}

/// What the bytes of an aligned node are relative to, prepared for the ray.
struct NodeSteps {
    step: vec3<f32>,
    near_start: vec3<f32>,
    far_start: vec3<f32>,
}

/// The boxes of an aligned node are bytes in the frame of the mesh, after Ylitie, Karras and Laine 2017. The third quad has where they start,
/// the exponents of their steps in three bytes, and a bit for each child that is a leaf. Then there is one quad for each half with the low
/// and high ends along x and y, and one with those along z.
fn node_steps(at: u32) -> NodeSteps {
    let head = nodes[at + 2u];
    let exponents = vec3<u32>(head.w << 23u, head.w << 15u, head.w << 7u) & vec3<u32>(0x7f800000u);
    let start = bitcast<vec3<f32>>(head.xyz) * space.recip;
    return NodeSteps(bitcast<vec3<f32>>(exponents) * space.recip, start - space.near, start - space.far);
}

/// Spans of four children of an aligned node.
fn aligned_spans(steps: NodeSteps, xy: vec4<u32>, z: vec2<u32>, t_max: f32) -> Spans {
    // For a negative direction the near plane is the upper one.
    let backward = space.recip < vec3<f32>(0.0);
    let near_x = bytes(select(xy.x, xy.y, backward.x)) * steps.step.x + vec4<f32>(steps.near_start.x);
    let near_y = bytes(select(xy.z, xy.w, backward.y)) * steps.step.y + vec4<f32>(steps.near_start.y);
    let near_z = bytes(select(z.x, z.y, backward.z)) * steps.step.z + vec4<f32>(steps.near_start.z);
    let far_x = bytes(select(xy.y, xy.x, backward.x)) * steps.step.x + vec4<f32>(steps.far_start.x);
    let far_y = bytes(select(xy.w, xy.z, backward.y)) * steps.step.y + vec4<f32>(steps.far_start.y);
    let far_z = bytes(select(z.y, z.x, backward.z)) * steps.step.z + vec4<f32>(steps.far_start.z);
    let near = max(max(near_x, near_y), max(near_z, vec4<f32>(space.t_min)));
    let far = min(min(far_x, far_y), min(far_z, vec4<f32>(t_max)));
    return Spans(near, far);
}

/// Spans of half the children of an aligned node.
fn spans_of_half(at: u32, half: u32, t_max: f32) -> Spans {
    let z = nodes[at + 5u];
    return aligned_spans(node_steps(at), nodes[at + 3u + half], select(z.xy, z.zw, half != 0u), t_max);
}

/// A mask of the children of an aligned node that the ray enters.
fn entered_of_aligned(at: u32, t_max: f32) -> u32 {
    let steps = node_steps(at);
    let z = nodes[at + 5u];
    let first = entered_of_half(aligned_spans(steps, nodes[at + 3u], z.xy, t_max));
    return first | (entered_of_half(aligned_spans(steps, nodes[at + 4u], z.zw, t_max)) << 4u);
}

/// The same of four children.
fn entered_of_half(spans: Spans) -> u32 {
    let bits = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), spans.near <= spans.far);
    return (bits.x | bits.y) | (bits.z | bits.w);
}

/// The bytes of a word.
fn bytes(word: u32) -> vec4<f32> {
    return vec4<f32>(vec4<u32>(word & 255u, (word >> 8u) & 255u, (word >> 16u) & 255u, word >> 24u));
}

/// Keys of four children of a node.
fn enter(word: u32, half: u32, t_max: f32) -> vec4<u32> {
    let spans = spans_of(word, half, t_max);
    let child = vec4<u32>(0u, 1u, 2u, 3u) + vec4<u32>(4u * half);
    // Entries are not negative, except for a negative zero.
    let key = (bitcast<vec4<u32>>(abs(spans.near)) & vec4<u32>(~7u)) | child;
    return select(vec4<u32>(MISSED), key, spans.near <= spans.far);
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

// choice node_kinds/aligned
// BVHs with aligned nodes only.
// use shared/bvh/node

/// Spans of four children of a node.
fn spans_of(word: u32, half: u32, t_max: f32) -> Spans {
    return spans_of_half(quads_of(word), half, t_max);
}

/// A mask of the children that the ray enters.
fn entered_of(word: u32, t_max: f32) -> u32 {
    return entered_of_aligned(quads_of(word), t_max);
}

/// A mask of the children that are leaves.
fn leaves_of(word: u32) -> u32 {
    return nodes[quads_of(word) + 2u].w >> 24u;
}

// choice node_kinds/any
// Aligned nodes, and oriented nodes with a frame per child (shared/frame).
// use shared/bvh/node
// use shared/frame

/// Spans of four children of a node.
fn spans_of(word: u32, half: u32, t_max: f32) -> Spans {
    let at = quads_of(word);
    switch word >> 29u {
        case 0u: {
            return spans_of_half(at, half, t_max);
        }
        default: {
            return oriented_spans(at + 2u + half, t_max);
        }
    }
}

/// A mask of the children that the ray enters.
fn entered_of(word: u32, t_max: f32) -> u32 {
    let at = quads_of(word);
    if (word >> 29u) == 0u {
        return entered_of_aligned(at, t_max);
    }
    var entered = 0u;
    for (var half = 0u; half < 2u; half += 1u) {
        entered |= entered_of_half(oriented_spans(at + 2u + half, t_max)) << (half << 2u);
    }
    return entered;
}

/// A mask of the children that are leaves.
fn leaves_of(word: u32) -> u32 {
    let at = quads_of(word);
    if (word >> 29u) == 0u {
        return nodes[at + 2u].w >> 24u;
    }
    let first = (nodes[at] >> vec4<u32>(31u)) << vec4<u32>(0u, 1u, 2u, 3u);
    let second = (nodes[at + 1u] >> vec4<u32>(31u)) << vec4<u32>(4u, 5u, 6u, 7u);
    let bits = first | second;
    return (bits.x | bits.y) | (bits.z | bits.w);
}

/// Frames, then rows: centers and half-extents along each of three axes.
fn oriented_spans(at: u32, t_max: f32) -> Spans {
    let frames = bitcast<vec4<i32>>(nodes[at]);
    let a = vec4<f32>(extractBits(frames, 0u, 11u)) * FRAME_STEP;
    let b = vec4<f32>(extractBits(frames, 11u, 11u)) * FRAME_STEP;
    let c = vec4<f32>(extractBits(frames, 21u, 11u)) * FRAME_STEP;
    let rest = 0.5 * ((FRAME_REAL * FRAME_REAL - a * a) - (b * b + c * c));
    var spans = Spans(vec4<f32>(space.t_min), vec4<f32>(t_max));
    spans = clipped(spans, at + 2u, rest + a * a, a * b - FRAME_REAL * c, a * c + FRAME_REAL * b);
    spans = clipped(spans, at + 6u, a * b + FRAME_REAL * c, rest + b * b, b * c - FRAME_REAL * a);
    return clipped(spans, at + 10u, a * c - FRAME_REAL * b, b * c + FRAME_REAL * a, rest + c * c);
}

/// Spans between the planes across the rows x, y, z of four children.
fn clipped(spans: Spans, at: u32, x: vec4<f32>, y: vec4<f32>, z: vec4<f32>) -> Spans {
    let from_center = x * space.origin.x + (y * space.origin.y + (z * space.origin.z - quad(at)));
    let d = x * space.direction.x + (y * space.direction.y + z * space.direction.z);
    let inverse = guarded_reciprocals(d);
    let center = from_center * inverse;
    let extent = (quad(at + 2u) + vec4<f32>(space.oriented_pad)) * abs(inverse);
    return Spans(max(-extent - center, spans.near), min(extent - center, spans.far));
}

/// `1/d`, bounded.
fn guarded_reciprocals(d: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(1.0) / select(d, vec4<f32>(MIN_DIRECTION), abs(d) < vec4<f32>(MIN_DIRECTION));
}

// part volume
// Where a ray enters the volume of a binary node's child.
// use shared/bvh

/// Entry of a volume that the ray does not enter.
const OUTSIDE: f32 = -1.0;

// part volume/entry
// Entries from the spans of `?volume`.
// use ?volume

/// Scaled `t` where the ray enters the child that starts at a quad, or `OUTSIDE`.
fn entry_of(at: u32, t_max: f32) -> f32 {
    let span = span_of(at);
    return select(OUTSIDE, span.x, span.x <= min(span.y, t_max));
}

// choice volume/aabb
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

// choice volume/obb
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
