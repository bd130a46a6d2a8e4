// Boxes that enclose their children exactly.
//
// # Derivation of the pad
// Let E = 2^-23. `+ - *` have a relative error of at most E, for any rounding direction, fused or not; a result that underflows
// may become zero. Coordinates are dot products with the stored axes F, relative to `origin`. All lengths are sums of absolute
// components: D is the largest distance of the content from the origin, c that of the center, and S = D + c.
//
// * A difference with the origin and a dot product take 1 + 3 roundings. A side's product, its dot product, the sum of three,
//   and the ends take 1 + 3 + 2 + 1: in total 8 E of D. The center takes 5 E of c. The difference for the half-extent and its
//   sum with the pad take 2 E of S. Including the rounding of the lengths and second-order terms: 12 E of S.
// * The true coordinates of a point are A^-1 F^T d with A = F^T F. They differ from F^T d by at most r / (1 - r) of S, where r
//   is the greatest row sum of |A - 1|. Measuring that sum takes 4 roundings per entry, 13 E per row. Frames with r > 2^-10 are
//   rejected.
//
// So the pad is (12 E + 1.01 r) S. TINY covers the underflow of fewer than a thousand operations.
// use shared/build/content
// use shared/build/slice

const ROUNDING: f32 = 1.1920929e-7;
const TINY: f32 = 1e-35;

/// Largest accepted deviation from orthonormal axes: 2^-10.
const SKEWNESS: f32 = 0.0009765625;

struct Box {
    center: vec3<f32>,
    frame: mat3x3<f32>,
    half_extents: vec3<f32>,
}

struct Extent {
    low: vec3<f32>,
    high: vec3<f32>,
    /// D in the derivation.
    size: f32,
}

const IDENTITY = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);

/// Coordinates in a frame.
fn along(frame: mat3x3<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(frame[0], v), dot(frame[1], v), dot(frame[2], v));
}

fn extent_of(frame: mat3x3<f32>, origin: vec3<f32>, content: Content) -> Extent {
    if content.is_box {
        let to_center = content.center - origin;
        let edges = sides(content);
        let midpoint = along(frame, to_center);
        let support = abs(along(frame, edges[0])) + abs(along(frame, edges[1])) + abs(along(frame, edges[2]));
        let size = length_1(to_center) + length_1(edges[0]) + length_1(edges[1]) + length_1(edges[2]);
        return Extent(midpoint - support, midpoint + support, size);
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

/// Greatest row sum of |F^T F - 1|, as computed.
fn skewness(frame: mat3x3<f32>) -> f32 {
    let xy = abs(dot(frame[0], frame[1]));
    let yz = abs(dot(frame[1], frame[2]));
    let zx = abs(dot(frame[2], frame[0]));
    let x = abs(dot(frame[0], frame[0]) - 1.0) + xy + zx;
    let y = abs(dot(frame[1], frame[1]) - 1.0) + xy + yz;
    let z = abs(dot(frame[2], frame[2]) - 1.0) + yz + zx;
    return max(max(x, y), z);
}

/// The box along `frame` that encloses both exactly; its half-extents are negative if the frame is rejected.
fn enclosed(frame: mat3x3<f32>, a: Content, b: Content) -> Box {
    let origin = a.center;
    let both = joined_extents(extent_of(frame, origin, a), extent_of(frame, origin, b));
    return box_around(frame, origin, both, skewness(frame) + 13.0 * ROUNDING);
}

fn joined_extents(a: Extent, b: Extent) -> Extent {
    return Extent(min(a.low, b.low), max(a.high, b.high), max(a.size, b.size));
}

/// The box along `frame` with this extent relative to `origin`; `skew` is an upper bound of r.
fn box_around(frame: mat3x3<f32>, origin: vec3<f32>, extent: Extent, skew: f32) -> Box {
    // This form also rejects NaN.
    if !(skew <= SKEWNESS) {
        return Box(origin, IDENTITY, vec3(-1.0));
    }
    // Any center is valid, because half-extents are measured from the stored value.
    let center = stored(origin + frame * (0.5 * (extent.low + extent.high)));
    let offset = center - origin;
    let midpoint = along(frame, offset);
    let pad = (12.0 * ROUNDING + 1.01 * skew) * (extent.size + length_1(offset)) + TINY;
    return Box(center, frame, max(extent.high - midpoint, midpoint - extent.low) + pad);
}

/// The box form of an axis-aligned box. The difference, the product and the factor's own rounding take 3 E of the half-extent.
/// A flat box stays flat.
fn box_from_aabb(low: vec3<f32>, high: vec3<f32>) -> Box {
    let midpoint = stored(0.5 * low + 0.5 * high);
    // Compared as integers, because a small difference may be flushed to zero.
    let flat = bitcast<vec3<u32>>(low) == bitcast<vec3<u32>>(high);
    let center = select(midpoint, low, flat);
    let half = max(high - center, center - low) * (1.0 + 4.0 * ROUNDING) + TINY;
    return Box(center, IDENTITY, select(half, vec3(0.0), flat));
}

/// Surface area of a box with orthonormal axes, divided by eight.
fn half_area(half: vec3<f32>) -> f32 {
    return half.x * half.y + half.y * half.z + half.z * half.x;
}
