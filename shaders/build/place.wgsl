// Instances of meshes: inverses of their transforms and boxes in world space.
// Reads: transforms, boxes of the meshes.
// Writes: instances as rays read them, one item of the top level for each, the bounds that the header of the top level holds, faults.
// Holds: an inverse has the CPU's bits, but for the signs of zeros; a box contains the image of the mesh's box. An instance with a fault,
// without triangles or that refers to no mesh is a point, and rays that reach it find an empty BVH.
//
// # Boxes
// Let E = 2^-23 bound one rounding, `m` a row of the transform, `c` and `h` center and half-extents of the mesh's box, and `S = |m| (|c| +
// h) + |shift|`. Half-extents are measured from the stored center: the difference errs by E of h. The image of the center is three
// products and three sums: 4 E of `|m| |c| + |shift|`. The half-extent of the image is three products and two sums, 4 E of `|m| h` with
// the one before. Its sum with the pad and the difference from the center are two more of at most S: 6 E of S. S itself errs by 5 E of
// it. 8 E covers second-order terms; TINY covers underflow.
//
// # Error of hits
// As on the host (`HitError::with`): `2 HIT_ERROR` times the condition number, relative to the origin of the ray; that times the
// reach of the mesh and of the shift for the constant part. Each takes fewer than 16 roundings, which are added.
// use shared/build/slice
// use shared/volumes/enclosure
// use shared/volumes/invert

struct InstanceLayout {
    /// First word of the first instance, and words from instance to instance.
    first_word: u32,
    stride: u32,
    n_meshes: u32,
    /// Reach of a header over the largest coordinate.
    reach: f32,
    /// Error of hits, relative to the largest coordinate.
    error: f32,
    /// Whether the word after the number of the mesh is a mask.
    has_masks: u32,
}

@group(0) @binding(1) var<uniform> instance_layout: InstanceLayout;
/// For each instance the rows of `world_from_object`, translations last, as f32, the number of its mesh, and perhaps its mask.
@group(0) @binding(2) var<storage, read> transforms: array<u32>;
/// From build/scene/mesh_boxes.
@group(0) @binding(3) var<storage, read> mesh_boxes: array<vec4<f32>>;
/// As `Instance` of shared/level: ten quads each.
@group(0) @binding(4) var<storage, read_write> instances: array<vec4<u32>>;
/// Items of the top level, as in shared/volumes, `item`.
@group(0) @binding(5) var<storage, read_write> item_boxes: array<f32>;
@group(0) @binding(6) var<storage, read_write> item_aabbs: array<f32>;
/// As `Bvh` of shared/bvh; the first is the top level.
@group(0) @binding(7) var<storage, read_write> top_header: array<atomic<u32>>;
/// The complement of the lowest instance that refers to no mesh, whose coordinates are not finite or too large, whose transform is
/// close to singular; zero for none.
@group(0) @binding(8) var<storage, read_write> instance_faults: array<atomic<u32>>;

/// The mesh of an instance that is not placed.
const NOT_PLACED: u32 = 0xffffffffu;

/// Largest coordinate that kernels support, and its bits.
const MAX_COORDINATE: f32 = 1e18;
const MAX_COORDINATE_BITS: u32 = 0x5d5e0b6bu;

/// Largest condition number of a transform.
const MAX_CONDITION: f32 = 1024.0;

/// Rounding up, by more than sixteen roundings.
const UP: f32 = 1.0 + 16.0 * ROUNDING;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let number = slice_item(id, 64u);
    if number >= slice.end {
        return;
    }
    let at = instance_layout.first_word + instance_layout.stride * number;
    let mesh = transforms[at + 12u];
    var rows: array<vec4<u32>, 3>;
    var is_finite = true;
    for (var k = 0u; k < 3u; k++) {
        rows[k] = vec4<u32>(transforms[at + 4u * k], transforms[at + 4u * k + 1u], transforms[at + 4u * k + 2u], transforms[at + 4u * k + 3u]);
        // As integers, because devices need not compare NaN.
        is_finite = is_finite && all((rows[k] & vec4<u32>(0x7fffffffu)) <= vec4<u32>(MAX_COORDINATE_BITS));
    }
    // Near its place, so that the top level stays small.
    let point = select(vec3<u32>(0u), vec3<u32>(rows[0].w, rows[1].w, rows[2].w), is_finite);
    put_nothing(number, bitcast<vec3<f32>>(point));
    if mesh == NOT_PLACED {
        return;
    }
    if mesh >= instance_layout.n_meshes {
        atomicMax(&instance_faults[0], ~number);
    } else if !is_finite {
        atomicMax(&instance_faults[1], ~number);
    } else if mesh_boxes[2u * mesh].w != 0.0 {
        var mask = 0xffffffffu;
        if instance_layout.has_masks != 0u {
            mask = transforms[at + 13u];
        }
        if mask == 0u {
            return;
        }
        place(number, mesh, rows, mask);
    }
}

/// An instance that no ray hits.
fn put_nothing(number: u32, at: vec3<f32>) {
    let zero = vec4<u32>(0u);
    for (var quad = 0u; quad < 10u; quad++) {
        // The last header is that of an empty BVH.
        instances[10u * number + quad] = select(zero, vec4<u32>(instance_layout.n_meshes + 1u, 0u, 0u, 0u), quad == 3u);
    }
    put_item(number, at, at);
}

fn place(number: u32, mesh: u32, rows: array<vec4<u32>, 3>, mask: u32) {
    var linear: mat3x3<f32>;
    var columns: array<array<Number, 3>, 4>;
    for (var k = 0u; k < 3u; k++) {
        let row = bitcast<vec4<f32>>(rows[k]);
        linear[k] = row.xyz;
        for (var j = 0u; j < 4u; j++) {
            columns[j][k] = from_f32(row[j]);
        }
    }
    let inverse = inverted(columns[0], columns[1], columns[2], columns[3]);
    if !inverse.is_sound {
        atomicMax(&instance_faults[2], ~number);
        return;
    }
    var quads: array<vec4<u32>, 10>;
    var backward = 0.0;
    for (var k = 0u; k < 3u; k++) {
        let row = vec3<u32>(f32_word(inverse.rows[k][0]), f32_word(inverse.rows[k][1]), f32_word(inverse.rows[k][2]));
        quads[k] = vec4<u32>(row, rows[k].w);
        backward = max(backward, length_1(bitcast<vec3<f32>>(row)));
        for (var j = 0u; j < 2u; j++) {
            quads[4u + 2u * k + j] = vec4<u32>(f64_words(inverse.rows[k][2u * j]), f64_words(inverse.rows[k][2u * j + 1u]));
        }
    }
    quads[3] = vec4<u32>(mesh + 1u, 0u, mask, 0u);
    let forward = max(length_1(linear[0]), max(length_1(linear[1]), length_1(linear[2])));
    // As an exact product, because it may be above the range of f32.
    if is_shorter(from_f32(MAX_CONDITION), multiplied(from_f32(forward), from_f32(backward))) {
        atomicMax(&instance_faults[2], ~number);
        return;
    }
    let low = mesh_boxes[2u * mesh].xyz;
    let high = mesh_boxes[2u * mesh + 1u].xyz;
    let shift = bitcast<vec3<f32>>(vec3<u32>(rows[0].w, rows[1].w, rows[2].w));
    let ends = max(abs(low), abs(high));
    let reach = greatest_of(ends);
    let far = greatest_of(abs(shift) + reach * vec3<f32>(length_1(linear[0]), length_1(linear[1]), length_1(linear[2]))) * UP;
    if far > MAX_COORDINATE {
        atomicMax(&instance_faults[1], ~number);
        return;
    }
    for (var quad = 0u; quad < 10u; quad++) {
        instances[10u * number + quad] = quads[quad];
    }
    let relative = 2.0 * instance_layout.error * (forward * backward) * UP;
    atomicMax(&top_header[3], bitcast<u32>(instance_layout.reach * far));
    atomicMax(&top_header[7], bitcast<u32>(relative));
    atomicMax(&top_header[11], bitcast<u32>(relative * (greatest_of(abs(shift)) + forward * reach) * UP));
    put_image(number, linear, shift, low, high);
}

fn greatest_of(v: vec3<f32>) -> f32 {
    return max(v.x, max(v.y, v.z));
}

/// The box around the image of a mesh's box.
fn put_image(number: u32, linear: mat3x3<f32>, shift: vec3<f32>, low: vec3<f32>, high: vec3<f32>) {
    let center = stored(0.5 * low + 0.5 * high);
    let half = max(high - center, center - low);
    var image_low: vec3<f32>;
    var image_high: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        let row = linear[k];
        let middle = dot(row, center) + shift[k];
        let sum = dot(abs(row), abs(center) + half) + abs(shift[k]);
        let reach = dot(abs(row), half) + (8.0 * ROUNDING * sum + TINY);
        image_low[k] = middle - reach;
        image_high[k] = middle + reach;
    }
    put_item(number, image_low, image_high);
}

/// Writes an item of the top level.
fn put_item(number: u32, low: vec3<f32>, high: vec3<f32>) {
    let box = box_from_aabb(low, high);
    let parts = array<vec3<f32>, 5>(box.center, box.frame[0], box.frame[1], box.frame[2], box.half_extents);
    for (var part = 0u; part < 5u; part++) {
        for (var k = 0u; k < 3u; k++) {
            item_boxes[15u * number + 3u * part + k] = parts[part][k];
        }
    }
    for (var k = 0u; k < 3u; k++) {
        item_aabbs[6u * number + k] = low[k];
        item_aabbs[6u * number + 3u + k] = high[k];
    }
}
