// Boxes, frames and what they contain: the volumes of nodes.

// part content
// The child of a node: a box or a triangle.
// use shared/build/length

/// A box, all points `center + columns * q` with `|q[k]| <= half_extents[k]`; or a triangle whose vertices are the columns.
struct Content {
    is_box: bool,
    /// Center of a box, a vertex of a triangle.
    center: vec3<f32>,
    columns: mat3x3<f32>,
    half_extents: vec3<f32>,
}

/// The three vectors from the center of a box to its faces.
fn sides(box: Content) -> mat3x3<f32> {
    return mat3x3<f32>(box.columns[0] * box.half_extents.x, box.columns[1] * box.half_extents.y, box.columns[2] * box.half_extents.z);
}

fn length_1(v: vec3<f32>) -> f32 {
    return abs(v.x) + abs(v.y) + abs(v.z);
}

/// Surface area; both sides of a triangle count.
fn content_area(content: Content) -> f32 {
    let columns = content.columns;
    if !content.is_box {
        return length_of(cross(columns[1] - columns[0], columns[2] - columns[0]));
    }
    let edges = sides(content);
    let faces = length_of(cross(edges[0], edges[1])) + length_of(cross(edges[1], edges[2])) + length_of(cross(edges[2], edges[0]));
    return 8.0 * faces;
}

// part enclosure
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
// use shared/volumes/content
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

// part boxes
// Boxes of the nodes, fifteen floats each: center, three axes, half-extents.
// use shared/volumes/enclosure

@group(0) @binding(5) var<storage, read_write> obbs: array<f32>;

fn part(slot: u32, index: u32) -> vec3<f32> {
    let at = 15u * slot + 3u * index;
    return vec3<f32>(obbs[at], obbs[at + 1u], obbs[at + 2u]);
}

fn put(slot: u32, index: u32, value: vec3<f32>) {
    let at = 15u * slot + 3u * index;
    obbs[at] = value.x;
    obbs[at + 1u] = value.y;
    obbs[at + 2u] = value.z;
}

fn put_box(slot: u32, volume: Box) {
    put(slot, 0u, volume.center);
    put(slot, 1u, volume.frame[0]);
    put(slot, 2u, volume.frame[1]);
    put(slot, 3u, volume.frame[2]);
    put(slot, 4u, volume.half_extents);
}

// part frame
// Orthonormal axes.
// use shared/volumes/content

/// A projected vector shorter than this fraction of its length is rounding error, not a direction.
const PARALLEL: f32 = 1e-5;

/// A unit vector perpendicular to the unit vector `x`.
fn across(x: vec3<f32>) -> vec3<f32> {
    let size = abs(x);
    if size.x <= size.y && size.x <= size.z {
        return normalize(vec3<f32>(0.0, -x.z, x.y));
    }
    if size.y <= size.z {
        return normalize(vec3<f32>(x.z, 0.0, -x.x));
    }
    return normalize(vec3<f32>(-x.y, x.x, 0.0));
}

/// Right-handed axes: the first along `first`, the second in the plane of both arguments, whose lengths must be near one.
/// Returns the identity if `first` is zero and any second axis if the arguments are parallel.
fn axes_along(first: vec3<f32>, second: vec3<f32>) -> mat3x3<f32> {
    if !(dot(first, first) > 1e-12) {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let x = normalize(first);
    let rest = second - x * dot(second, x);
    var y = across(x);
    if dot(rest, rest) > PARALLEL * PARALLEL {
        // A short remainder carries the rounding of the projection; a second projection removes it.
        let unit = normalize(rest);
        y = normalize(unit - x * dot(unit, x));
    }
    return mat3x3<f32>(x, y, cross(x, y));
}

/// Axes of a triangle: along its longest edge, in its plane, and the normal. `size` is a length of similar magnitude.
fn triangle_axes(corners: mat3x3<f32>, size: f32) -> mat3x3<f32> {
    let ab = (corners[1] - corners[0]) / size;
    let bc = (corners[2] - corners[1]) / size;
    let ca = (corners[0] - corners[2]) / size;
    let lengths = vec3<f32>(dot(ab, ab), dot(bc, bc), dot(ca, ca));
    if lengths.x >= lengths.y && lengths.x >= lengths.z {
        return axes_along(ab, bc);
    }
    if lengths.y >= lengths.z {
        return axes_along(bc, ca);
    }
    return axes_along(ca, ab);
}

// part eigen
// Principal axes: eigenvectors of symmetric matrices.
// use shared/volumes/frame

/// Maximum number of sweeps. Convergence is quadratic.
const MAX_SWEEPS: u32 = 6u;

/// Relative off-diagonal entry that counts as zero: the precision of `f32`.
const COUPLING: f32 = 2.4e-7;

/// Squared off-diagonal entry that counts as zero for entries near one.
const NEGLIGIBLE: f32 = 1e-30;

/// A symmetric matrix during diagonalization. Entry k of `coupling` is the off-diagonal entry of the two axes other than k.
struct Diagonalization {
    diagonal: vec3<f32>,
    coupling: vec3<f32>,
    axes: mat3x3<f32>,
}

/// Rotates axes p and q about axis r so that their off-diagonal entry becomes zero (Jacobi 1846).
fn jacobi_rotation(given: Diagonalization, p: u32, q: u32, r: u32) -> Diagonalization {
    var before = given;
    var rotated = given;
    let coupled = before.coupling[r];
    if coupled * coupled <= COUPLING * COUPLING * abs(before.diagonal[p] * before.diagonal[q]) + NEGLIGIBLE {
        return rotated;
    }
    let difference = before.diagonal[q] - before.diagonal[p];
    let twice = 2.0 * coupled;
    let adjacent = abs(difference) + sqrt(difference * difference + twice * twice);
    let opposite = select(twice, -twice, difference < 0.0);
    let hypotenuse = sqrt(adjacent * adjacent + opposite * opposite);
    if !(hypotenuse > 1e-15) {
        return rotated;
    }
    let cosine = adjacent / hypotenuse;
    let sine = opposite / hypotenuse;
    let change = opposite / adjacent * coupled;
    rotated.diagonal[p] -= change;
    rotated.diagonal[q] += change;
    rotated.coupling[r] = 0.0;
    let with_p = before.coupling[q];
    let with_q = before.coupling[p];
    rotated.coupling[q] = cosine * with_p - sine * with_q;
    rotated.coupling[p] = sine * with_p + cosine * with_q;
    rotated.axes[p] = cosine * before.axes[p] - sine * before.axes[q];
    rotated.axes[q] = sine * before.axes[p] + cosine * before.axes[q];
    return rotated;
}

/// Orthonormal eigenvectors of a matrix with entries near one, the longest axis first. `diagonal` is xx, yy, zz; `coupling` is
/// yz, xz, xy.
fn principal_axes(diagonal: vec3<f32>, coupling: vec3<f32>) -> mat3x3<f32> {
    var rotated = Diagonalization(diagonal, coupling, mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0));
    for (var sweep = 0u; sweep < MAX_SWEEPS; sweep++) {
        rotated = jacobi_rotation(rotated, 0u, 1u, 2u);
        rotated = jacobi_rotation(rotated, 0u, 2u, 1u);
        rotated = jacobi_rotation(rotated, 1u, 2u, 0u);
    }
    let values = rotated.diagonal;
    let x_first = values.x >= values.y && values.x >= values.z;
    let y_first = !x_first && values.y >= values.z;
    if x_first {
        let y_second = values.y >= values.z;
        return axes_along(rotated.axes[0], select(rotated.axes[2], rotated.axes[1], y_second));
    }
    if y_first {
        return axes_along(rotated.axes[1], select(rotated.axes[2], rotated.axes[0], values.x >= values.z));
    }
    return axes_along(rotated.axes[2], select(rotated.axes[1], rotated.axes[0], values.x >= values.y));
}

// part bounded
// Principal axes of the corners of two children, each weighted by its area: sixteen, eleven or six corners.
// Source: Ericson 2004; Sabino 2020, 3.5, variant 2, with the covariance of a box's corners in closed form.
// use shared/volumes/eigen

struct Moments {
    weight: f32,
    mean: vec3<f32>,
    diagonal: vec3<f32>,
    coupling: vec3<f32>,
}

fn add_square(moments: Moments, v: vec3<f32>, weight: f32) -> Moments {
    var sum = moments;
    sum.diagonal += weight * v * v;
    sum.coupling += weight * v.yzx * v.zxy;
    return sum;
}

/// Moments of a child's corners about `origin`, in units of `size`.
fn moments_of(content: Content, origin: vec3<f32>, size: f32, weight: f32) -> Moments {
    if content.is_box {
        let edges = sides(content);
        var moments = Moments(weight, (content.center - origin) / size, vec3(0.0), vec3(0.0));
        for (var a = 0u; a < 3u; a++) {
            moments = add_square(moments, edges[a] / size, weight);
        }
        return moments;
    }
    let a = (content.columns[0] - origin) / size;
    let b = (content.columns[1] - origin) / size;
    let c = (content.columns[2] - origin) / size;
    let mean = (a + b + c) / 3.0;
    var moments = Moments(weight, mean, vec3(0.0), vec3(0.0));
    moments = add_square(moments, a - mean, weight / 3.0);
    moments = add_square(moments, b - mean, weight / 3.0);
    return add_square(moments, c - mean, weight / 3.0);
}

/// Largest extent of both from the center of the first. Dividing by it brings the moments near one.
fn size_of(a: Content, b: Content) -> f32 {
    return max(size_from(a, a.center), size_from(b, a.center));
}

fn size_from(content: Content, origin: vec3<f32>) -> f32 {
    if content.is_box {
        let edges = sides(content);
        return length_1(content.center - origin) + length_1(edges[0]) + length_1(edges[1]) + length_1(edges[2]);
    }
    let columns = content.columns;
    return max(max(length_1(columns[0] - origin), length_1(columns[1] - origin)), length_1(columns[2] - origin));
}

fn bounded_frame(a: Content, b: Content) -> mat3x3<f32> {
    let size = size_of(a, b);
    if !(size > 1e-30) {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let areas = vec2<f32>(content_area(a), content_area(b));
    let sum = areas.x + areas.y;
    // The weights sum to one. Corners count instead of areas if neither child has any area.
    let corners = vec2<f32>(select(3.0, 8.0, a.is_box), select(3.0, 8.0, b.is_box));
    let weights = select(corners / (corners.x + corners.y), areas / max(sum, 1e-37), sum > 1e-36);
    let of_a = moments_of(a, a.center, size, weights.x);
    let of_b = moments_of(b, a.center, size, weights.y);
    var all = Moments(1.0, vec3(0.0), of_a.diagonal + of_b.diagonal, of_a.coupling + of_b.coupling);
    all = add_square(all, of_b.mean - of_a.mean, weights.x * weights.y);
    return principal_axes(all.diagonal, all.coupling);
}

// part quaternion
// Rotations as quaternions: x, y, z, w.
// use shared/volumes/frame

/// Square root of one half.
const ROOT_HALF: f32 = 0.70710678;

/// Rotation by `q`, then by `p`.
fn product(p: vec4<f32>, q: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(p.w * q.xyz + q.w * p.xyz + cross(p.xyz, q.xyz), p.w * q.w - dot(p.xyz, q.xyz));
}

/// The rotation of right-handed orthonormal axes; divides by the largest component (Shepperd 1978).
fn quaternion_of(axes: mat3x3<f32>) -> vec4<f32> {
    let trace = axes[0].x + axes[1].y + axes[2].z;
    let squares = vec4<f32>(
        1.0 + 2.0 * axes[0].x - trace,
        1.0 + 2.0 * axes[1].y - trace,
        1.0 + 2.0 * axes[2].z - trace,
        1.0 + trace,
    );
    let turn = vec3<f32>(axes[1].z - axes[2].y, axes[2].x - axes[0].z, axes[0].y - axes[1].x);
    let xy = axes[1].x + axes[0].y;
    let xz = axes[2].x + axes[0].z;
    let yz = axes[2].y + axes[1].z;
    let largest = max(max(squares.x, squares.y), max(squares.z, squares.w));
    if largest == squares.w {
        return normalize(vec4<f32>(turn, squares.w));
    }
    if largest == squares.x {
        return normalize(vec4<f32>(squares.x, xy, xz, turn.x));
    }
    if largest == squares.y {
        return normalize(vec4<f32>(xy, squares.y, yz, turn.y));
    }
    return normalize(vec4<f32>(xz, yz, squares.z, turn.z));
}

/// The axes of a unit quaternion, orthonormalized.
fn axes_of(q: vec4<f32>) -> mat3x3<f32> {
    let x = vec3<f32>(1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y));
    let y = vec3<f32>(2.0 * (q.x * q.y - q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z + q.w * q.x));
    return axes_along(x, y);
}

/// The rotational symmetry of the cube nearest to `r`: along its largest component, its two largest, or all four.
fn nearest_symmetry(r: vec4<f32>) -> vec4<f32> {
    let size = abs(r);
    var first = 0u;
    for (var k = 1u; k < 4u; k++) {
        if size[k] > size[first] {
            first = k;
        }
    }
    var second = select(0u, 1u, first == 0u);
    for (var k = 1u; k < 4u; k++) {
        if k != first && size[k] > size[second] {
            second = k;
        }
    }
    let one = size[first];
    let two = (one + size[second]) * ROOT_HALF;
    let four = 0.5 * (size.x + size.y + size.z + size.w);
    let signs = select(vec4<f32>(1.0), vec4<f32>(-1.0), r < vec4<f32>(0.0));
    if four > one && four > two {
        return 0.5 * signs;
    }
    var nearest = vec4<f32>(0.0);
    nearest[first] = 1.0;
    if two > one {
        nearest[first] = ROOT_HALF;
        nearest[second] = ROOT_HALF;
    }
    return nearest * signs;
}

/// Weighted mean of two frames, after the symmetry of the box that brings the second nearest to the first.
/// Source: Ericson 2004, 6.5.3, made robust; for equal weights the chordal mean (Markley et al. 2007).
fn axes_between(a: mat3x3<f32>, b: mat3x3<f32>, weights: vec2<f32>) -> mat3x3<f32> {
    let p = quaternion_of(a);
    let q = quaternion_of(b);
    let conjugate = vec4<f32>(-q.xyz, q.w);
    let near = product(q, nearest_symmetry(product(conjugate, p)));
    let sum = weights.x + weights.y;
    let share = select(vec2(0.5), weights / max(sum, 1e-37), sum > 1e-36);
    return axes_of(normalize(p * share.x + near * share.y));
}

// part slab
// Oriented boxes as slabs.
//
// # Half-extents
// A point of the box is `c + F q` with `|q_j| <= h_j`, for any columns F: boxes of instances may be scaled and
// skewed. Along an axis w, of length 1 or less, it lies within the sum of `|w F_j| h_j`. With E = 2^-23, a dot
// product errs by 3 E of its absolute terms, less than 4 E as computed; the sum and the products with h_j take four more
// roundings, and 6 E covers these.
// use shared/volumes/enclosure

/// The unit vector along a column, and the half-extent of the box along it.
fn slab_of(columns: mat3x3<f32>, half_extents: vec3<f32>, k: u32) -> vec4<f32> {
    var all = columns;
    let axis = unit_along(all[k]);
    return vec4<f32>(axis, extent_along(axis, columns, half_extents));
}

/// The half-extent of a box along an axis.
fn extent_along(axis: vec3<f32>, columns: mat3x3<f32>, half_extents: vec3<f32>) -> f32 {
    let along = abs(vec3<f32>(dot(axis, columns[0]), dot(axis, columns[1]), dot(axis, columns[2])));
    let size = abs(axis);
    let sizes = vec3<f32>(dot(size, abs(columns[0])), dot(size, abs(columns[1])), dot(size, abs(columns[2])));
    return dot(along + 4.0 * ROUNDING * sizes, half_extents) * (1.0 + 6.0 * ROUNDING) + TINY;
}

/// The unit vector along a column, of any length above 1e-30. Its own rounding moves the axis, not the half-extent along it.
fn unit_along(v: vec3<f32>) -> vec3<f32> {
    let size = max(abs(v.x), max(abs(v.y), abs(v.z)));
    return normalize(v / max(size, 1e-30));
}

// part dop
// Extents of small nodes, computed leaf by leaf and relative to a point of the node. This is cheaper than propagating them and
// gives tighter boxes far from the origin, where pads would dominate.
// use shared/volumes/enclosure
// use shared/build/tree
// use ?item

const SMALL_NODE_LEAVES: u32 = 8u;

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
/// The item of each leaf.
@group(0) @binding(2) var<storage, read> leaves: array<u32>;

fn is_small(node: Node) -> bool {
    return node.last - node.first < SMALL_NODE_LEAVES;
}

/// Extent of the leaves from `first` to `last`.
fn extent_of_leaves(frame: mat3x3<f32>, origin: vec3<f32>, first: u32, last: u32) -> Extent {
    var extent = extent_of(frame, origin, item_content(leaves[first]));
    for (var leaf = first + 1u; leaf <= last; leaf++) {
        extent = joined_extents(extent, extent_of(frame, origin, item_content(leaves[leaf])));
    }
    return extent;
}

// A fixed frame, the same for all nodes.

struct FixedFrame {
    frame: mat3x3<f32>,
    /// Upper bound of the greatest row sum of |F^T F - 1|.
    skewness: f32,
}

@group(0) @binding(4) var<uniform> fixed_frame: FixedFrame;

// part invert
// The inverse of an affine map, with the CPU's operations in the CPU's order, each rounded to f64: the CPU's bits, but for the signs
// of zeros.
//
// Numbers are f32, so products of two are exact, and no operation leaves the range of f64.
// use shared/exact/number

/// Rows of an inverse, translations last. It is not sound if the map is singular, or if an entry is at least 2^MOST_BITS.
struct Inverted {
    rows: array<array<Number, 4>, 3>,
    is_sound: bool,
}

/// Entries up to this power of two are f32, and so are sums of three.
const MOST_BITS: i32 = 100;

/// `1 / a` of a number that is not zero, not rounded.
fn inverse_of(a: Number) -> Number {
    // 2^126 over the mantissa, bit by bit: the remainder is below it.
    var rest = vec2<u32>(0x80000000u, 0u);
    var quotient = vec2<u32>(0u);
    if a.high == 0x80000000u && a.low == 0u {
        rest = vec2<u32>(0u);
        quotient = vec2<u32>(0u, 1u);
    }
    for (var bit = 0u; bit < 63u; bit++) {
        let carry = rest.x >> 31u;
        rest = vec2<u32>((rest.x << 1u) | (rest.y >> 31u), rest.y << 1u);
        quotient = vec2<u32>((quotient.x << 1u) | (quotient.y >> 31u), quotient.y << 1u);
        if carry != 0u || rest.x > a.high || (rest.x == a.high && rest.y >= a.low) {
            rest = vec2<u32>(rest.x - a.high - u32(rest.y < a.low), rest.y - a.low);
            quotient.y |= 1u;
        }
    }
    quotient.y |= u32((rest.x | rest.y) != 0u);
    return normalized(quotient, -126 - a.exponent, a.is_negative);
}

/// `a b - c d` of f32.
fn difference_of_products(a: Number, b: Number, c: Number, d: Number) -> Number {
    return as_f64(added(multiplied(a, b), negated(multiplied(c, d))));
}

fn crossed(p: array<Number, 3>, q: array<Number, 3>) -> array<Number, 3> {
    return array<Number, 3>(
        difference_of_products(p[1], q[2], p[2], q[1]),
        difference_of_products(p[2], q[0], p[0], q[2]),
        difference_of_products(p[0], q[1], p[1], q[0]),
    );
}

/// The product of an f32 and an f64.
fn product_of(a: Number, b: Number) -> Number {
    return as_f64(multiplied(a, b));
}

fn dotted(p: array<Number, 3>, q: array<Number, 3>) -> Number {
    let two = as_f64(added(product_of(p[0], q[0]), product_of(p[1], q[1])));
    return as_f64(added(two, product_of(p[2], q[2])));
}

/// The inverse of the map with these columns.
fn inverted(a: array<Number, 3>, b: array<Number, 3>, c: array<Number, 3>, origin: array<Number, 3>) -> Inverted {
    var inverse: Inverted;
    var rows = array<array<Number, 3>, 3>(crossed(b, c), crossed(c, a), crossed(a, b));
    let determinant = dotted(a, rows[0]);
    inverse.is_sound = determinant.high != 0u;
    if !inverse.is_sound {
        return inverse;
    }
    let scale = as_f64(inverse_of(determinant));
    for (var k = 0u; k < 3u; k++) {
        for (var j = 0u; j < 3u; j++) {
            let entry = product_of(rows[k][j], scale);
            rows[k][j] = entry;
            inverse.rows[k][j] = entry;
            // The highest bit of the mantissa is worth 2^(63 + exponent).
            inverse.is_sound = inverse.is_sound && (entry.high == 0u || entry.exponent + 64 <= MOST_BITS);
        }
        inverse.rows[k][3] = negated(dotted(rows[k], origin));
    }
    return inverse;
}

/// The words of an f64, the lower half first; zero below its normal numbers.
fn f64_words(a: Number) -> vec2<u32> {
    let biased = a.exponent + (63 + 1023);
    if a.high == 0u || biased <= 0 {
        return vec2<u32>(0u);
    }
    let high = (u32(a.is_negative) << 31u) | (u32(biased) << 20u) | ((a.high >> 11u) & 0xfffffu);
    return vec2<u32>((a.high << 21u) | (a.low >> 11u), high);
}

/// The bits of the nearest f32 of a number below 2^MOST_BITS.
fn f32_word(a: Number) -> u32 {
    let b = as_f32(a);
    if b.high == 0u {
        return 0u;
    }
    let biased = b.exponent + (63 + 127);
    let sign = u32(b.is_negative) << 31u;
    if biased > 0 {
        return sign | (u32(biased) << 23u) | ((b.high >> 8u) & 0x7fffffu);
    }
    return sign | (b.high >> u32(9 - biased));
}

// part rule/average
// The mean of the frames of two children.
// use shared/volumes/quaternion
// use shared/volumes/bounded

/// Frame of a child. The axes of a sheared box are orthonormalized in order.
fn axes_of_child(content: Content, size: f32) -> mat3x3<f32> {
    if content.is_box {
        let x = content.columns[0];
        let y = content.columns[1];
        return axes_along(x / max(length_1(x), 1e-30), y / max(length_1(y), 1e-30));
    }
    return triangle_axes(content.columns, size);
}

fn average_frame(a: Content, b: Content) -> mat3x3<f32> {
    let size = size_of(a, b);
    if !(size > 1e-30) {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let areas = vec2<f32>(content_area(a), content_area(b));
    return axes_between(axes_of_child(a, size), axes_of_child(b, size), areas);
}

// choice rule/pca_bounded
// Frame of a node: principal axes of the corners of its children.
// use shared/volumes/bounded

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return bounded_frame(a, b);
}

// choice rule/quaternion
// Frame of a node: area-weighted mean of the children's rotations.
// use shared/volumes/rule/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return average_frame(a, b);
}

// choice rule/combined
// Frame of a node by kind of child: mean rotation for two boxes, principal axes otherwise. Source: Sabino 2020, 3.5.
// use shared/volumes/rule/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    if a.is_box && b.is_box {
        return average_frame(a, b);
    }
    return bounded_frame(a, b);
}

// choice item/boxes
// Boxes as items, represented by the axis-aligned boxes around them.
// use shared/build/ordered
// use shared/volumes/content

/// Number of points summed for the code of an item.
const N_POINTS: f32 = 2.0;

/// Float bits of the minima and maxima, six per box.
@group(1) @binding(0) var<storage, read> item_aabbs: array<u32>;

/// Fifteen floats per box: center, three axes, half-extents.
@group(1) @binding(1) var<storage, read> item_boxes: array<f32>;

fn box_ends(item: u32, side: u32) -> vec3<u32> {
    let at = 6u * item + 3u * side;
    return vec3<u32>(item_aabbs[at], item_aabbs[at + 1u], item_aabbs[at + 2u]);
}

fn item_sum(item: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(box_ends(item, 0u)) + bitcast<vec3<f32>>(box_ends(item, 1u));
}

fn item_reach(item: u32) -> Reach {
    let low = box_ends(item, 0u);
    let high = box_ends(item, 1u);
    return Reach(reach_of(low.x, low.y, low.z).low, reach_of(high.x, high.y, high.z).high);
}

fn box_part(item: u32, part: u32) -> vec3<f32> {
    let at = 15u * item + 3u * part;
    return vec3<f32>(item_boxes[at], item_boxes[at + 1u], item_boxes[at + 2u]);
}

fn item_content(item: u32) -> Content {
    let columns = mat3x3<f32>(box_part(item, 1u), box_part(item, 2u), box_part(item, 3u));
    return Content(true, box_part(item, 0u), columns, box_part(item, 4u));
}

// choice item/triangles
// Triangles as items, represented by their vertices.
// use shared/build/ordered
// use shared/volumes/content

/// Number of points summed for the code of an item.
const N_POINTS: f32 = 3.0;

/// Float bits of the coordinates, nine per triangle.
@group(1) @binding(0) var<storage, read> corners: array<u32>;

fn corner(item: u32, k: u32) -> vec3<f32> {
    let at = 9u * item + 3u * k;
    return bitcast<vec3<f32>>(vec3<u32>(corners[at], corners[at + 1u], corners[at + 2u]));
}

fn item_sum(item: u32) -> vec3<f32> {
    return (corner(item, 0u) + corner(item, 1u)) + corner(item, 2u);
}

fn item_reach(item: u32) -> Reach {
    var reach = reach_of(corners[9u * item], corners[9u * item + 1u], corners[9u * item + 2u]);
    for (var at = 9u * item + 3u; at < 9u * item + 9u; at += 3u) {
        reach = joined(reach, reach_of(corners[at], corners[at + 1u], corners[at + 2u]));
    }
    return reach;
}

fn item_content(item: u32) -> Content {
    let columns = mat3x3<f32>(corner(item, 0u), corner(item, 1u), corner(item, 2u));
    return Content(false, columns[0], columns, vec3(0.0));
}
