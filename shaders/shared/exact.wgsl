// part number
// IEEE arithmetic in integers, which every device computes exactly.
//
// WGSL leaves rounding modes, fused operations and the flushing of small numbers to the device. Where a decision must be the
// CPU's to the bit, a number is `m * 2^exponent` with a mantissa of 64 bits: sums and products keep more bits than an f64, with
// the lowest bit set if any bit below it was, and one rounding to nearest, ties to even, makes them those of the CPU.

/// Bits of the mantissa of an f64, and of an f32.
const F64_BITS: i32 = 53;
const F32_BITS: i32 = 24;

/// A number: the top bit of its mantissa is set, unless it is zero.
struct Number {
    high: u32,
    low: u32,
    exponent: i32,
    is_negative: bool,
}

/// The number with this mantissa.
fn normalized(mantissa: vec2<u32>, exponent: i32, is_negative: bool) -> Number {
    let is_short = mantissa.x == 0u;
    let high = select(mantissa.x, mantissa.y, is_short);
    let low = select(mantissa.y, 0u, is_short);
    if high == 0u {
        return Number(0u, 0u, 0, false);
    }
    let n = countLeadingZeros(high);
    // A shift by 32 is undefined.
    let carried = select(low >> (32u - max(n, 1u)), 0u, n == 0u);
    return Number((high << n) | carried, low << n, exponent - i32(n) - select(0, 32, is_short), is_negative);
}

fn from_f32(x: f32) -> Number {
    let bits = bitcast<u32>(x);
    let exponent = (bits >> 23u) & 0xffu;
    let mantissa = (bits & 0x7fffffu) | select(0x800000u, 0u, exponent == 0u);
    return normalized(vec2<u32>(0u, mantissa), i32(max(exponent, 1u)) - 150, (bits >> 31u) != 0u);
}

/// The f64 with these bits, the lower half first.
fn from_f64(bits: vec2<u32>) -> Number {
    let exponent = (bits.y >> 20u) & 0x7ffu;
    let high = (bits.y & 0xfffffu) | select(0x100000u, 0u, exponent == 0u);
    return normalized(vec2<u32>(high, bits.x), i32(max(exponent, 1u)) - 1075, (bits.y >> 31u) != 0u);
}

fn negated(a: Number) -> Number {
    return Number(a.high, a.low, a.exponent, !a.is_negative);
}

/// Whether `|a| < |b|`.
fn is_shorter(a: Number, b: Number) -> bool {
    if a.high == 0u || b.high == 0u {
        return b.high != 0u;
    }
    if a.exponent != b.exponent {
        return a.exponent < b.exponent;
    }
    return a.high < b.high || (a.high == b.high && a.low < b.low);
}

/// A mantissa without its lowest `n` bits. If one of these is set, so is the lowest that remains.
fn shifted(mantissa: vec2<u32>, n: u32) -> vec2<u32> {
    if n == 0u {
        return mantissa;
    }
    if n < 32u {
        let rest = (mantissa.y << (32u - n)) != 0u;
        return vec2<u32>(mantissa.x >> n, (mantissa.x << (32u - n)) | (mantissa.y >> n) | u32(rest));
    }
    if n < 64u {
        let above = select(mantissa.x << (64u - max(n, 33u)), 0u, n == 32u);
        return vec2<u32>(0u, (mantissa.x >> (n - 32u)) | u32((above | mantissa.y) != 0u));
    }
    return vec2<u32>(0u, u32((mantissa.x | mantissa.y) != 0u));
}

/// `a + b` of numbers of at most 63 bits, not rounded.
fn added(a: Number, b: Number) -> Number {
    if a.high == 0u {
        return b;
    }
    if b.high == 0u {
        return a;
    }
    var long = a;
    var short = b;
    if is_shorter(a, b) {
        long = b;
        short = a;
    }
    // One bit is left free for the carry.
    let p = shifted(vec2<u32>(long.high, long.low), 1u);
    var q = shifted(vec2<u32>(short.high, short.low), u32(long.exponent - short.exponent) + 1u);
    let is_difference = long.is_negative != short.is_negative;
    if is_difference {
        // The complement of two.
        q = vec2<u32>(~q.x + u32(q.y == 0u), ~q.y + 1u);
    }
    let low = p.y + q.y;
    return normalized(vec2<u32>(p.x + q.x + u32(low < p.y), low), long.exponent + 1, long.is_negative);
}

/// The product of two words, the upper half first.
fn word_product(a: u32, b: u32) -> vec2<u32> {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let mixed = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let other = (a & 0xffffu) * (b >> 16u) + (mixed & 0xffffu);
    return vec2<u32>((a >> 16u) * (b >> 16u) + (mixed >> 16u) + (other >> 16u), (other << 16u) | (low & 0xffffu));
}

/// `a * b`, not rounded.
fn multiplied(a: Number, b: Number) -> Number {
    let top = word_product(a.high, b.high);
    let left = word_product(a.high, b.low);
    let right = word_product(a.low, b.high);
    let bottom = word_product(a.low, b.low);
    // The third and second words from below.
    let first = bottom.x + left.y;
    let second = first + right.y;
    let carry = u32(first < left.y) + u32(second < right.y);
    let sum = top.y + left.x;
    let third = sum + right.x;
    let all = third + carry;
    let high = top.x + u32(sum < left.x) + u32(third < right.x) + u32(all < carry);
    let rest = u32((second | bottom.y) != 0u);
    return normalized(vec2<u32>(high, all | rest), a.exponent + b.exponent + 64, a.is_negative != b.is_negative);
}

/// `a / b` of numbers of 24 bits, not rounded. The divisor is not zero.
fn divided(a: Number, b: Number) -> Number {
    let divisor = b.high >> 8u;
    let dividend = a.high >> 8u;
    // The first digit is 0 or 1, the other four have seven bits.
    let first = (dividend % divisor) << 7u;
    let second = (first % divisor) << 7u;
    let third = (second % divisor) << 7u;
    let fourth = (third % divisor) << 7u;
    let upper = ((dividend / divisor) << 14u) | ((first / divisor) << 7u) | (second / divisor);
    let quotient = (upper << 14u) | ((third / divisor) << 7u) | (fourth / divisor);
    let rest = u32(fourth % divisor != 0u);
    return normalized(vec2<u32>(0u, quotient | rest), a.exponent - b.exponent - 28, a.is_negative != b.is_negative);
}

/// The nearest number of so many bits, at least none and at most 60; ties to even.
fn rounded(a: Number, n_bits: i32) -> Number {
    // Two more bits decide.
    let more = shifted(vec2<u32>(a.high, a.low), u32(62 - n_bits));
    let last = more.y & 7u;
    // Above half, or half and odd.
    let up = u32((last & 3u) == 3u || last == 6u);
    let kept = shifted(vec2<u32>(more.x, more.y & ~3u), 2u);
    let low = kept.y + up;
    return normalized(vec2<u32>(kept.x + u32(low < up), low), a.exponent + 64 - n_bits, a.is_negative);
}

/// The nearest f64.
fn as_f64(a: Number) -> Number {
    return rounded(a, F64_BITS);
}

/// The nearest f32, also below 2^-126.
fn as_f32(a: Number) -> Number {
    // The lowest bit of an f32 is worth 2^-149, the highest bit of the mantissa 2^(63 + exponent).
    let n_bits = a.exponent + (63 + 149 + 1);
    if n_bits < 0 {
        return Number(0u, 0u, 0, false);
    }
    return rounded(a, min(n_bits, F32_BITS));
}

// part flat
// A triangle without area as an edge, which no ray hits: twin of `flat_as_edge` in `canted-obb`.
//
// Differs: a triangle with an edge of more than 32 bits in a coordinate counts as one with area.
// use shared/exact/number

/// A bound of the error of a projected area in f32, relative to its two products, with any rounding.
const AREA_ERROR: f32 = 1e-5;

fn is_equal(a: Number, b: Number) -> bool {
    let is_zero = a.high == 0u && b.high == 0u;
    return is_zero || (a.high == b.high && a.low == b.low && a.exponent == b.exponent && a.is_negative == b.is_negative);
}

/// Whether the vertices, nine words, are on a line or equal.
fn is_flat(words: array<u32, 9>) -> bool {
    var u: array<Number, 3>;
    var v: array<Number, 3>;
    var is_short = true;
    for (var k = 0u; k < 3u; k++) {
        let a = negated(from_f32(bitcast<f32>(words[k])));
        u[k] = added(from_f32(bitcast<f32>(words[k + 3u])), a);
        v[k] = added(from_f32(bitcast<f32>(words[k + 6u])), a);
        is_short = is_short && (u[k].low | v[k].low) == 0u;
    }
    for (var k = 0u; k < 3u; k++) {
        let next = (k + 1u) % 3u;
        is_short = is_short && is_equal(multiplied(u[k], v[next]), multiplied(u[next], v[k]));
    }
    return is_short;
}

/// Whether a triangle has an area for sure, by f32.
fn has_area(words: array<u32, 9>) -> bool {
    let a = vec3<f32>(bitcast<f32>(words[0]), bitcast<f32>(words[1]), bitcast<f32>(words[2]));
    let u = vec3<f32>(bitcast<f32>(words[3]), bitcast<f32>(words[4]), bitcast<f32>(words[5])) - a;
    let v = vec3<f32>(bitcast<f32>(words[6]), bitcast<f32>(words[7]), bitcast<f32>(words[8])) - a;
    let left = u * v.yzx;
    let right = u.yzx * v;
    return any(abs(left - right) > AREA_ERROR * (abs(left) + abs(right)));
}

/// A coordinate as an integer of the same order; -0.0 is 0.0.
fn order_of(word: u32) -> u32 {
    let magnitude = word & 0x7fffffffu;
    return select(0x80000000u + magnitude, 0x80000000u - magnitude, word >= 0x80000000u);
}

/// The words of a triangle, or of the edge that it is.
fn flat_as_edge(words: array<u32, 9>) -> array<u32, 9> {
    var edge = words;
    if has_area(words) || !is_flat(words) {
        return edge;
    }
    for (var axis = 0u; axis < 3u; axis++) {
        let a = order_of(words[axis]);
        let b = order_of(words[axis + 3u]);
        let c = order_of(words[axis + 6u]);
        if a == b && b == c {
            continue;
        }
        let is_first_between = (b < a && a < c) || (c < a && a < b);
        let is_third_between = min(a, b) <= c && c <= max(a, b);
        let replaced = select(select(1u, 2u, is_third_between), 0u, is_first_between);
        let source = select(0u, 1u, is_first_between);
        for (var k = 0u; k < 3u; k++) {
            edge[3u * replaced + k] = words[3u * source + k];
        }
        break;
    }
    return edge;
}

// part triangle
// Whether the CPU's watertight test hits a triangle, decided as the CPU decides it.
//
// The ray that the CPU traces, its shear and the sheared vertices are computed with the CPU's operations in the CPU's order, and
// the signs of the edge functions are exact.
// use shared/exact/number
// use shared/triangle
// use shared/invocation/iterations

/// The ray of the query.
var<private> world_ray: Ray;

/// A ray of the CPU. The direction is known but for a power of two.
struct ExactRay {
    origin: array<Number, 3>,
    direction: array<Number, 3>,
    is_known: bool,
}

/// The same ray, prepared for triangles.
struct ExactShear {
    /// Axes that become x, y, z.
    axes: vec3<u32>,
    origin: array<Number, 3>,
    factors: array<Number, 2>,
    is_known: bool,
}

var<private> exact_shear: ExactShear;

/// Loop iterations to prepare a ray, and to decide on a triangle. Drivers that count also count the one in which a loop ends.
const SHEAR_ITERATIONS: u32 = 27u;
const EXACT_ITERATIONS: u32 = 17u;

/// The CPU's ray of a BVH without a transform.
fn exact_ray_of(ray: Ray) -> ExactRay {
    var exact: ExactRay;
    for (var k = 0u; k < 3u; k++) {
        exact.origin[k] = from_f32(ray.origin[k]);
        exact.direction[k] = from_f32(ray.direction[k]);
    }
    exact.is_known = true;
    return exact;
}

/// Prepares the CPU's ray for triangles.
fn prepare_exact_shear(ray: ExactRay) {
    iterations += SHEAR_ITERATIONS;
    let scaled = scaled_direction(ray.direction);
    let axes = exact_axes(scaled);
    exact_shear.axes = axes;
    exact_shear.origin = ray.origin;
    exact_shear.factors[0] = as_f32(divided(scaled[axes.x], scaled[axes.z]));
    exact_shear.factors[1] = as_f32(divided(scaled[axes.y], scaled[axes.z]));
    exact_shear.is_known = ray.is_known;
}

/// Whether the CPU's triangle is hit somewhere on the ray's line. The vertices have permuted axes.
fn is_hit_on_cpu(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    iterations += EXACT_ITERATIONS;
    let vertices = array<vec3<f32>, 3>(from_axes(a), from_axes(b), from_axes(c));
    var sheared: array<array<Number, 2>, 3>;
    for (var i = 0u; i < 3u; i++) {
        let depth = from_origin_exactly(vertices[i], exact_shear.axes.z);
        for (var k = 0u; k < 2u; k++) {
            let shift = as_f32(multiplied(exact_shear.factors[k], depth));
            sheared[i][k] = as_f32(added(from_origin_exactly(vertices[i], exact_shear.axes[k]), negated(shift)));
        }
    }
    var n_positive = 0u;
    var n_negative = 0u;
    for (var i = 0u; i < 3u; i++) {
        let p = sheared[(i + 2u) % 3u];
        let q = sheared[(i + 1u) % 3u];
        let edge = added(multiplied(p[0], q[1]), negated(multiplied(p[1], q[0])));
        n_positive += u32(edge.high != 0u && !edge.is_negative);
        n_negative += u32(edge.high != 0u && edge.is_negative);
    }
    return (n_positive == 0u) != (n_negative == 0u);
}

/// The direction as f32, its largest component in 1..2.
fn scaled_direction(direction: array<Number, 3>) -> array<Number, 3> {
    var largest = direction[0];
    for (var k = 1u; k < 3u; k++) {
        if is_shorter(largest, direction[k]) {
            largest = direction[k];
        }
    }
    var scaled = direction;
    for (var k = 0u; k < 3u; k++) {
        scaled[k].exponent -= largest.exponent + 63;
        if scaled[k].high != 0u {
            scaled[k] = as_f32(scaled[k]);
        }
    }
    return scaled;
}

/// The axes that become x, y and z: z is that of the largest component, the first of equals.
fn exact_axes(d: array<Number, 3>) -> vec3<u32> {
    if !is_shorter(d[0], d[1]) && !is_shorter(d[0], d[2]) {
        return vec3<u32>(1u, 2u, 0u);
    }
    if !is_shorter(d[1], d[2]) {
        return vec3<u32>(2u, 0u, 1u);
    }
    return vec3<u32>(0u, 1u, 2u);
}

/// A vertex with permuted axes in its own.
fn from_axes(v: vec3<f32>) -> vec3<f32> {
    return select(select(v, v.yzx, shear.axis == 1u), v.zxy, shear.axis == 0u);
}

/// A coordinate of a vertex relative to the origin.
fn from_origin_exactly(vertex: vec3<f32>, axis: u32) -> Number {
    return as_f32(added(from_f32(vertex[axis]), negated(exact_shear.origin[axis])));
}
