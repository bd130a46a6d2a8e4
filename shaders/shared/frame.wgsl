// Frames of 32 bits, of the children of oriented wide nodes; twin of crates/gpu/src/trace/frames.rs.
//
// A frame is the rotation by a quaternion `(n, a, b, c)`, whose components are whole multiples of 2^-11: n is 2470 of them, and a, b, c
// have 11 bits each with their signs, from bit 0, bit 11 and bit 21 on. So the last bit of c is the sign of b. The rows of the matrix are
// not divided by the square of the length of the quaternion but by 2: they are between 0.72 and 1 long. Centers and half-extents are
// along these rows, so spans of `t` are those along unit vectors, and pads for unit vectors are enough.
//
// All sums and products in the matrix are whole multiples of 2^-23 below 2, of fewer than 24 bits. Single precision has them without
// rounding, in any order and fused or not, so the rows are the same numbers everywhere.

/// Step of the components of a quaternion, and its real component.
const FRAME_STEP: f32 = 0.00048828125;
const FRAME_REAL: f32 = 1.2060546875;

// part nearest
// Frames of boxes.
// use shared/frame

/// The frame nearest to the axes of a box. Their order and directions do not matter, so of all boxes that differ in these it is that of
/// the one nearest to no rotation: then the components of the quaternion are at most `FRAME_REAL` times the square root of 2 less 1.
fn nearest_frame(axes: mat3x3<f32>) -> u32 {
    var all = axes;
    let is_mirrored = determinant(axes) < 0.0;
    var most = 0.0;
    var sines = vec3<f32>(0.0);
    for (var order = 0u; order < 6u; order++) {
        // The first three orders are even.
        let first = order % 3u;
        let second = (first + select(2u, 1u, order < 3u)) % 3u;
        let x = all[first];
        let y = all[second];
        let z = all[3u - first - second];
        let diagonal = vec3<f32>(x.x, y.y, z.z);
        let sizes = abs(diagonal);
        let negative = diagonal < vec3<f32>(0.0);
        var signs = select(vec3<f32>(1.0), vec3<f32>(-1.0), negative);
        if (signs.x * signs.y * signs.z < 0.0) != (is_mirrored != (order >= 3u)) {
            let is_least = vec3<bool>(sizes.x <= min(sizes.y, sizes.z), sizes.y < sizes.x && sizes.y <= sizes.z, sizes.z < min(sizes.x, sizes.y));
            signs = select(signs, -signs, is_least);
        }
        let trace = dot(signs, diagonal);
        if trace > most {
            most = trace;
            sines = vec3<f32>(signs.z * z.y - signs.y * y.z, signs.x * x.z - signs.z * z.x, signs.y * y.x - signs.x * x.y);
        }
    }
    let steps = sines * (FRAME_REAL / (FRAME_STEP * (1.0 + most)));
    let a = steps_of(steps.x, -1023.0, 1023.0);
    let b = steps_of(steps.y, -1023.0, 1023.0);
    // Odd where b is negative.
    let half_of_c = steps_of(0.5 * (steps.z - f32(b >> 31u)), -512.0, 511.0);
    return (a & 0x7ffu) | ((b & 0x7ffu) << 11u) | (half_of_c << 22u);
}

fn steps_of(x: f32, least: f32, most: f32) -> u32 {
    return bitcast<u32>(i32(round(clamp(x, least, most))));
}

/// The rows of a frame.
fn rows_of_frame(frame: u32) -> mat3x3<f32> {
    let bits = bitcast<i32>(frame);
    let a = f32(extractBits(bits, 0u, 11u)) * FRAME_STEP;
    let b = f32(extractBits(bits, 11u, 11u)) * FRAME_STEP;
    let c = f32(extractBits(bits, 21u, 11u)) * FRAME_STEP;
    let n = FRAME_REAL;
    let rest = 0.5 * ((n * n - a * a) - (b * b + c * c));
    return mat3x3<f32>(
        rest + a * a, a * b - n * c, a * c + n * b,
        a * b + n * c, rest + b * b, b * c - n * a,
        a * c - n * b, b * c + n * a, rest + c * c,
    );
}
