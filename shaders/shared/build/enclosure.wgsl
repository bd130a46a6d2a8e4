// Boxes around children, never too small.
//
// # How the pad is derived
// With E = 2^-23: `+ - *` are off by at most E, whichever way they round, fused or not; what underflows may become zero.
// Coordinates are dot products with the stored axes F, measured from `origin`. All lengths are sums of absolute components; D is
// the greatest of the content from the origin, c that of the midpoint, and S = D + c.
//
// * A difference to the origin, then a dot product, 1 + 3 roundings; a side's product, its dot product and the sum over three,
//   1 + 3 + 2, and one for the ends: 8 E of D. The midpoint takes 5 E of c. The half-extent's difference and its sum with
//   the pad take 2 E of S. With the lengths' own roundings and second order 12 E of S.
// * A point's true coordinates are A^-1 F^T d with A = F^T F, which differ from F^T d by the greatest row sum r of |A - 1|,
//   over 1 - r, of S. Where the sum is measured, 4 roundings an entry add 13 E a row. Frames with r > 2^-10 are refused.
//
// So the pad is (12 E + 1.01 r) S; TINY stands for what underflows in fewer than a thousand operations.
// use shared/build/content
// use shared/build/slice

const ROUNDING: f32 = 1.1920929e-7;
const TINY: f32 = 1e-35;

/// Most that axes may lack of being orthonormal: 2^-10.
const SKEWNESS: f32 = 0.0009765625;

struct Box {
    center: vec3<f32>,
    frame: mat3x3<f32>,
    half_extents: vec3<f32>,
}

struct Extent {
    low: vec3<f32>,
    high: vec3<f32>,
    /// D.
    size: f32,
}

const IDENTITY = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);

/// Coordinates along the axes of a frame.
fn along(frame: mat3x3<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(frame[0], v), dot(frame[1], v), dot(frame[2], v));
}

fn extent_of(frame: mat3x3<f32>, origin: vec3<f32>, content: Content) -> Extent {
    if content.is_box {
        let to_center = content.center - origin;
        let edges = sides(content);
        let middle = along(frame, to_center);
        let support = abs(along(frame, edges[0])) + abs(along(frame, edges[1])) + abs(along(frame, edges[2]));
        let size = length_1(to_center) + length_1(edges[0]) + length_1(edges[1]) + length_1(edges[2]);
        return Extent(middle - support, middle + support, size);
    }
    let a = content.columns[0] - origin;
    let b = content.columns[1] - origin;
    let c = content.columns[2] - origin;
    let ya = along(frame, a);
    let yb = along(frame, b);
    let yc = along(frame, c);
    let size = max(max(length_1(a), length_1(b)), length_1(c));
    return Extent(min(min(ya, yb), yc), max(max(ya, yb), yc), size);
}

/// Greatest row sum of |F^T F - 1|, as measured.
fn skewness(frame: mat3x3<f32>) -> f32 {
    let xy = abs(dot(frame[0], frame[1]));
    let yz = abs(dot(frame[1], frame[2]));
    let zx = abs(dot(frame[2], frame[0]));
    let x = abs(dot(frame[0], frame[0]) - 1.0) + xy + zx;
    let y = abs(dot(frame[1], frame[1]) - 1.0) + xy + yz;
    let z = abs(dot(frame[2], frame[2]) - 1.0) + yz + zx;
    return max(max(x, y), z);
}

/// The box along the axes of `frame` around both, which contains them exactly; of negative half-extents where the frame is refused.
fn enclosed(frame: mat3x3<f32>, a: Content, b: Content) -> Box {
    let origin = a.center;
    let both = joined_extents(extent_of(frame, origin, a), extent_of(frame, origin, b));
    return box_around(frame, origin, both, skewness(frame) + 13.0 * ROUNDING);
}

fn joined_extents(a: Extent, b: Extent) -> Extent {
    return Extent(min(a.low, b.low), max(a.high, b.high), max(a.size, b.size));
}

/// The box along the axes of `frame` around what has this extent from `origin`; `skew` is not less than r.
fn box_around(frame: mat3x3<f32>, origin: vec3<f32>, extent: Extent, skew: f32) -> Box {
    // Also what is no number is refused.
    if !(skew <= SKEWNESS) {
        return Box(origin, IDENTITY, vec3(-1.0));
    }
    // Any midpoint will do, since half-extents are measured from it as stored.
    let center = stored(origin + frame * (0.5 * (extent.low + extent.high)));
    let offset = center - origin;
    let middle = along(frame, offset);
    let pad = (12.0 * ROUNDING + 1.01 * skew) * (extent.size + length_1(offset)) + TINY;
    return Box(center, frame, max(extent.high - middle, middle - extent.low) + pad);
}

/// The box along the axes of the space around an axis-aligned one: the difference, the product and the factor's own rounding take
/// 3 E of the half-extent. A flat box stays flat.
fn box_from_aabb(low: vec3<f32>, high: vec3<f32>) -> Box {
    let middle = stored(0.5 * low + 0.5 * high);
    // Compared as integers, for a small difference may be flushed to zero.
    let flat = bitcast<vec3<u32>>(low) == bitcast<vec3<u32>>(high);
    let center = select(middle, low, flat);
    let half = max(high - center, center - low) * (1.0 + 4.0 * ROUNDING) + TINY;
    return Box(center, IDENTITY, select(half, vec3(0.0), flat));
}

/// Surface area of a box along orthonormal axes, over eight.
fn half_area(half: vec3<f32>) -> f32 {
    return half.x * half.y + half.y * half.z + half.z * half.x;
}
