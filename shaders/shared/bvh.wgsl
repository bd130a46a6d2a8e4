// Trees of eight-wide nodes as the CPU walks them, and the ray in the space of one.
//
// # No lost hit
// What the CPU's loop over all triangles finds is found here too, with no more asked of the device than WGSL promises.
// Let E = 2^-23: `+ - *` are off by less than E, whichever way they round; quotients by 2.5 E; `a * b + c` may round once
// or twice; what underflows may become zero. `S = |o| + reach`, greatest coordinates of the origin and of any vertex.
//
// A triangle test may report `t` for which the point lies within `e` of its triangle in each coordinate: 64 E of S (derived
// at shared/triangle), and what an instance's transform adds (shared/level/instances). The ray is thickened by `e` and by what the
// test of a box rounds, after the proof at the head of `canted_wide`'s traversal with other numbers:
//
// * Boxes along the axes of the mesh's frame: planes are met at `lo * r - (o + pad) * r`. Two products, the moved origin, and
//   for the way `t * d` the quotient and the difference: E (1 + 1 + 1 + 3.5) = 6.5 E of S.
// * Frame of the mesh turned: origin and direction are three terms each, at most three roundings a term, along a row whose
//   absolute components sum to at most sqrt(3): with the above sqrt(3) (6 + 6.5) E of S.
// * A frame for each child: four roundings in `row * o - c`, three in `row * d`, then the product `q * a`, the padded
//   half-extent, its product, and 3.5 for `t * d'`: sqrt(3) (7 + 1 + 1 + 1 + 3.5) E of S.
//
// One or one and a half E more stand for second order and for the rounding of the pads. `TINY` covers underflow for
// scenes between 2^-50 and 2^60 in size.
// use shared/ray

/// A bound of one rounding, relative: 2^-23.
const ROUNDING: f32 = 1.1920929e-7;

/// Added to every pad: more than what becomes zero by underflow.
const TINY: f32 = 1e-36;

/// Square root of three, rounded up.
const ROOT_3: f32 = 1.7320509;

/// Roundings of a box test, relative to S: along the axes, along a turned frame's, along a child's own.
const BOX_ROUNDING: f32 = 7.5 * ROUNDING;
const ROTATED_ROUNDING: f32 = 14.0 * ROUNDING;
const LEAN_ROUNDING: f32 = 15.0 * ROUNDING;

/// Least absolute component of a direction in a box test, 2^-64.
const LEAST_DIRECTION: f32 = 5.421010862427522e-20;

/// A tree among those that lie in `nodes` and `triangle_blocks`.
struct Bvh {
    /// Rows of the frame that its box nodes stand in; then the greatest coordinate of any vertex.
    row_x: vec4<f32>,
    /// Then how far hits may be off, as a part of the origin's greatest coordinate.
    row_y: vec4<f32>,
    /// Then what is added to that.
    row_z: vec4<f32>,
    /// Root word, first node and first block in quads of words, whether the frame is turned.
    words: vec4<u32>,
}

@group(0) @binding(0) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read> triangle_blocks: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> bvhs: array<Bvh>;

/// The ray as nodes and triangles of a tree want it; `t` is scaled, so that the direction's greatest component is in [1, 2).
struct Space {
    origin: vec3<f32>,
    direction: vec3<f32>,
    t_min: f32,
    /// Scaled `t` of a caller's, a power of two, and its reciprocal.
    to_scaled: f32,
    from_scaled: f32,
    /// Of box nodes: reciprocals, what is taken off products of near and far planes, first quads of near planes.
    recip: vec3<f32>,
    near: vec3<f32>,
    far: vec3<f32>,
    near_quads: vec3<u32>,
    pad_lean: f32,
    /// By how much the ray may be off another's, in sheared coordinates: per distance, and in all.
    drift: vec2<f32>,
    first_node: u32,
    first_half: u32,
    instance: u32,
}

var<private> space: Space;

/// Greatest absolute component.
fn greatest(v: vec3<f32>) -> f32 {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

/// `1/d`, bounded.
fn reciprocal(d: f32) -> f32 {
    return select(1.0, -1.0, d < 0.0) / max(abs(d), LEAST_DIRECTION);
}

/// Takes the ray into `tree`'s space; `drift` is in units of that space, the second for a direction of any length.
/// Returns the tree's root, or an empty word where the direction is as good as zero.
fn enter_bvh(index: u32, origin: vec3<f32>, direction: vec3<f32>, t_min: f32, drift: vec2<f32>, instance: u32) -> u32 {
    let bvh = bvhs[index];
    // The power of two at or below the greatest component; its reciprocal must not underflow.
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
    space.first_half = bvh.words.z;
    space.instance = instance;
    thicken(bvh);
    return bvh.words.x;
}

/// Prepares the ray for boxes: moved by pads, in the frame of the mesh.
fn thicken(bvh: Bvh) {
    let far_off = greatest(space.origin);
    let scale = far_off + bvh.row_x.w;
    let error = (bvh.row_y.w * far_off + bvh.row_z.w) + 2.0 * (space.drift.y * scale + space.drift.x);
    // The error lengthens the way to the hit.
    let size = scale + error;
    space.pad_lean = ROOT_3 * (error + LEAN_ROUNDING * size) + TINY;
    var pad = error + BOX_ROUNDING * size + TINY;
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
    // Rows are two quads; against a negative direction the near plane is the upper one.
    space.near_quads = vec3<u32>(0u, 4u, 8u) + select(vec3<u32>(0u), vec3<u32>(2u), backward);
}

fn rotated(bvh: Bvh, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(project(bvh.row_x.xyz, v), project(bvh.row_y.xyz, v), project(bvh.row_z.xyz, v));
}

fn project(row: vec3<f32>, v: vec3<f32>) -> f32 {
    return (row.x * v.x + row.y * v.y) + row.z * v.z;
}

/// The scaled `t` of a caller's one, never infinite.
fn scaled_t(t: f32) -> f32 {
    if space.to_scaled > 1.0 && t >= FAR * space.from_scaled {
        return FAR;
    }
    return t * space.to_scaled;
}

/// The caller's `t` of a scaled one, never infinite.
fn caller_t(t: f32) -> f32 {
    if space.from_scaled > 1.0 && t >= FAR * space.to_scaled {
        return FAR;
    }
    return t * space.from_scaled;
}
