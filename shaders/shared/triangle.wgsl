// Ray-triangle intersection: a conservative test, then an exact one for each candidate.
//
// # What is hit
// As in `canted_trace`'s watertight test the ray becomes the z axis: `x = a_x - s_x a_z` for a vertex `a` relative to the
// origin. That test decides by exact signs, for which WGSL has no arithmetic. Here the signs are certain but within a bound of an
// edge. A triangle that near is a hit for `intersect_triangle`, and shared/exact repeats the CPU's decision before the hit counts.
// So hits are those of the CPU, except in an instance that moves, where every triangle within the bound is hit. Let E = 2^-23
// bound one rounding and let M be the largest coordinate of the three `a`; all sheared coordinates are at most 2 M.
//
// *Coordinates.* `a` errs by E, `s` by 2.5 E, product and difference by E each: 7.5 E M. The CPU's vertices may err by 5 E M,
// with a shear along another axis. Including the error of an instance's transform (`space.drift`), the coordinates differ from
// the CPU's by at most `g = 12.5 E M + drift.y M + drift.x`. The CPU's triangle contains the origin.
//
// *Filter.* An edge function of the CPU's triangle differs from the computed `b_x c_y - b_y c_x` by at most `g` times the four
// coordinates plus `2 g g`, and by its own roundings, `2 E (|b_x c_y| + |b_y c_x|) <= 4 E M (|b_x| + |b_y|)`. With N the sum of
// the three vertices' coordinates, `(g + 5 E M) (N + 2 g)` is an upper bound. If one function is beyond it on one side and
// another on the other side, the CPU misses. M is the maximum for the whole ray.
//
// *Edges.* The CPU's triangle moves into the computed one with no vertex moving by more than `g`. If the origin lies in the
// first but not in the second, an edge sweeps over it. So some computed edge passes within `2 g` of it along the edge's shorter
// axis, measured where its longer axis is zero, or at its end. The quotient `p / (p - q)` there has no cancellation: it errs by
// 4.5 E, and the other coordinate by at most `(4.5 + 2) E |p|`, because the slope of the edge is at most 1. So the test with `2
// g + 15 E M` loses nothing.
//
// *Inside.* Where the line x = 0 crosses two edges, above and below the origin, the crossings are quotients without cancellation,
// and so is the position between them. If the computed triangle contains the origin and no edge passes within 40 E M, it is so,
// and the CPU's triangle, no vertex of which is off by more than `g`, contains the origin, too.
//
// *Error.* The weights describe a point of the computed triangle. On an edge its distance from the ray is at most `2 g + (15 +
// 6) E M`, of which 6 are for rounding the position and the weights, and its z errs by 3 E M; inside the values are 27 E M and
// 7 E M. The computed triangle errs by 7.5 E M across and E M along, and `t` is rounded by 2.5 E. Without drift that is `(25 +
// 21 + 7.5) E M` across and 6.5 E M along the ray, which shear adds up to 60 E M in each coordinate; 64 covers second-order
// terms.
//
// Source: Woop, Benthin, Wald 2013 for the shear.
// use shared/bvh

/// Largest difference from the CPU's sheared coordinates, relative to M.
const SHEAR_ROUNDING: f32 = 12.5 * ROUNDING;

/// Additional error of an edge function, relative to M and the sum of coordinates.
const FILTER_ROUNDING: f32 = 5.0 * ROUNDING;

/// Error of a position on an edge, relative to M.
const EDGE_ROUNDING: f32 = 15.0 * ROUNDING;

/// Smallest divisor.
const MIN_DIVISOR: f32 = 1.1754944e-38;

/// The ray prepared for triangle tests: the axis that becomes z, with the others in cyclic order, and the shear.
struct Shear {
    axis: u32,
    origin: vec3<f32>,
    factors: vec2<f32>,
    /// Component of the direction along z.
    depth: f32,
    /// `g + 5 E M` for the largest M of any triangle in the BVH, and `2 g`.
    apart: vec2<f32>,
}

var<private> shear: Shear;

/// Whether shared/exact has prepared the current ray.
var<private> is_exact: bool;

/// Hit of a triangle: scaled `t` and barycentric weights. `t` is negative for a miss.
struct TriangleHit {
    t: f32,
    weights: vec3<f32>,
    /// Whether an edge is so near that the CPU may miss.
    is_near: bool,
}

/// Prepares the shear for the current ray and vertices within `scale` of its origin.
fn prepare_triangles(scale: f32) {
    let d = abs(space.direction);
    shear.axis = 2u;
    if d.x >= d.y && d.x >= d.z {
        shear.axis = 0u;
    } else if d.y >= d.z {
        shear.axis = 1u;
    }
    shear.origin = along_axes(space.origin);
    let direction = along_axes(space.direction);
    shear.depth = direction.z;
    shear.factors = vec2<f32>(guarded_quotient(direction.x, direction.z), guarded_quotient(direction.y, direction.z));
    let apart = shear_error(scale);
    is_exact = false;
    shear.apart = vec2<f32>(apart + FILTER_ROUNDING * scale, 2.0 * apart);
}

/// Largest difference of sheared coordinates from the CPU's, for a triangle within `m`.
fn shear_error(m: f32) -> f32 {
    return (SHEAR_ROUNDING + space.drift.y) * m + space.drift.x;
}

fn along_axes(v: vec3<f32>) -> vec3<f32> {
    return select(select(v, v.zxy, shear.axis == 1u), v.yzx, shear.axis == 0u);
}

/// `a / b`, or zero for a zero divisor.
fn guarded_quotient(a: f32, b: f32) -> f32 {
    return select(a / b, 0.0, abs(b) < MIN_DIVISOR);
}

fn sheared(v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(v.xy - shear.factors * v.z, v.z);
}

/// Tests a triangle by its vertices relative to the origin, with permuted axes: a hit if the CPU may hit.
fn intersect_triangle(from_a: vec3<f32>, from_b: vec3<f32>, from_c: vec3<f32>) -> TriangleHit {
    let m = max(greatest(from_a), max(greatest(from_b), greatest(from_c)));
    let corners = array<vec3<f32>, 3>(sheared(from_a), sheared(from_b), sheared(from_c));
    var weights = inside(corners);
    let nearest = nearest_edge(corners);
    let is_near = nearest.w <= 2.0 * shear_error(m) + EDGE_ROUNDING * m + TINY;
    if weights.w < 0.0 {
        if !is_near {
            return TriangleHit(-1.0, vec3<f32>(0.0), false);
        }
        weights = nearest;
    }
    let z = weights.x * corners[0].z + (weights.y * corners[1].z + weights.z * corners[2].z);
    return TriangleHit(guarded_quotient(z, shear.depth), weights.xyz, is_near);
}

/// Weights of the point on an edge that is nearest to the ray, and its distance.
fn nearest_edge(corners: array<vec3<f32>, 3>) -> vec4<f32> {
    let ab = on_edge(corners[0], corners[1]);
    let bc = on_edge(corners[1], corners[2]);
    let ca = on_edge(corners[2], corners[0]);
    var nearest = vec4<f32>(1.0 - ab.x, ab.x, 0.0, ab.y);
    if bc.y < nearest.w {
        nearest = vec4<f32>(0.0, 1.0 - bc.x, bc.x, bc.y);
    }
    if ca.y < nearest.w {
        nearest = vec4<f32>(ca.x, 0.0, 1.0 - ca.x, ca.y);
    }
    return nearest;
}

/// The point of an edge where its longer axis is zero, or the nearest end: weight of `q`, and distance.
fn on_edge(p: vec3<f32>, q: vec3<f32>) -> vec2<f32> {
    let length = abs(q.xy - p.xy);
    let is_x = length.x >= length.y;
    let start = select(p.y, p.x, is_x);
    let end = select(q.y, q.x, is_x);
    let s = clamp(guarded_quotient(start, start - end), 0.0, 1.0);
    let point = p.xy + s * (q.xy - p.xy);
    return vec2<f32>(s, max(abs(point.x), abs(point.y)));
}

/// Weights of the point where the ray crosses the triangle; the last component is negative for a miss.
fn inside(corners: array<vec3<f32>, 3>) -> vec4<f32> {
    let right = vec3<bool>(corners[0].x >= 0.0, corners[1].x >= 0.0, corners[2].x >= 0.0);
    if right.x == right.y && right.y == right.z {
        return vec4<f32>(-1.0);
    }
    // The vertex that is alone on its side of x = 0, then the other two in order.
    let is_first = right.y == right.z;
    let is_second = right.x == right.z;
    let p = select(select(corners[2], corners[1], is_second), corners[0], is_first);
    let q = select(select(corners[0], corners[2], is_second), corners[1], is_first);
    let r = select(select(corners[1], corners[0], is_second), corners[2], is_first);
    let weights = across(p, q, r);
    return select(select(weights.yzxw, weights.zxyw, is_second), weights, is_first);
}

/// The same with `p` alone: between the points where its edges cross x = 0.
fn across(p: vec3<f32>, q: vec3<f32>, r: vec3<f32>) -> vec4<f32> {
    let to_q = clamp(guarded_quotient(p.x, p.x - q.x), 0.0, 1.0);
    let to_r = clamp(guarded_quotient(p.x, p.x - r.x), 0.0, 1.0);
    let y_q = p.y + to_q * (q.y - p.y);
    let y_r = p.y + to_r * (r.y - p.y);
    if min(y_q, y_r) > 0.0 || max(y_q, y_r) < 0.0 {
        return vec4<f32>(-1.0);
    }
    let s = clamp(guarded_quotient(y_q, y_q - y_r), 0.0, 1.0);
    let weight_q = (1.0 - s) * to_q;
    let weight_r = s * to_r;
    return vec4<f32>((1.0 - weight_q) - weight_r, weight_q, weight_r, 0.0);
}

// part records
// The triangles of leaves: three quads for each, a vertex in each, and its number in the fourth word of the first.

/// Bits of a leaf word for its first triangle.
const LEAF_FIRST: u32 = 0x03ffffffu;

/// Quads of a triangle.
const TRIANGLE_QUADS: u32 = 3u;

/// First quad of the triangles of a leaf.
fn first_of_leaf(word: u32) -> u32 {
    return space.first_triangle + TRIANGLE_QUADS * (word & LEAF_FIRST);
}

/// Number of triangles of a leaf.
fn size_of_leaf(word: u32) -> u32 {
    return ((word >> 26u) & 31u) + 1u;
}

/// A vertex with permuted axes.
fn vertex(at: u32) -> vec3<f32> {
    return along_axes(bitcast<vec3<f32>>(leaf_triangles[at].xyz));
}

// part leaf
// The best hit of a traversal.
// use shared/triangle
// use shared/exact/triangle
// use ?level
// use ?mask
// use ?count
// use shared/invocation/iterations
// use shared/invocation/incomplete

/// Whether traversal came to its end. If not, the driver ended a loop early.
var<private> is_done: bool;

/// Where the triangle of the current test lies, as `vertex_at_place` reads it.
var<private> tested_place: u32;

/// Best hit so far. `t` is in the caller's units, the primitive is numbered by its BVH.
var<private> best: Hit;

/// Scaled `t` of the best hit.
var<private> t_max: f32;

/// Tests triangle `number` of the BVH, by its vertices with permuted axes, and keeps its hit if it is the best.
fn consider(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, number: u32) {
    // The CPU misses triangles with two equal vertices. Relative to the origin of an instance's ray, others may be equal, too.
    if all(a == b) || all(b == c) || all(c == a) {
        return;
    }
    let found = intersect_triangle(a - shear.origin, b - shear.origin, c - shear.origin);
    // `t` in the caller's units decides, as everywhere.
    if found.t >= space.t_min && found.t <= t_max {
        let hit = Hit(caller_t(found.t), found.weights.y, found.weights.z, number, space.instance);
        if before(hit, best) && (!found.is_near || is_hit_exactly(a, b, c)) && accepts(placed(hit)) {
            best = hit;
            t_max = found.t;
        }
    }
}

/// Whether the CPU hits a triangle with an edge near the ray, or may hit it, in an instance that moves.
fn is_hit_exactly(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    if !is_exact {
        prepare_exact_shear(exact_ray());
        is_exact = true;
    }
    return !exact_shear.is_known || is_hit_on_cpu(a, b, c);
}

// part leaf/records
// Triangle tests of the leaves of wide BVHs.
// use shared/triangle/records

/// Tests the triangles of a leaf: all by a filter, then those that the ray may hit.
fn triangle_leaf(word: u32) {
    let first = first_of_leaf(word);
    let n = size_of_leaf(word);
    count_triangles(n);
    // One in which each loop ends.
    iterations += n + 2u;
    var pending = 0u;
    for (var i = 0u; i < n; i += 1u) {
        pending |= select(0u, 1u << i, is_candidate(first + TRIANGLE_QUADS * i));
    }
    iterations += countOneBits(pending);
    loop {
        if pending == 0u {
            break;
        }
        let at = first + TRIANGLE_QUADS * firstTrailingBit(pending);
        pending &= pending - 1u;
        tested_place = at;
        consider(vertex(at), vertex(at + 1u), vertex(at + 2u), leaf_triangles[at].w);
    }
}

/// A vertex of the triangle at a place: its first quad.
fn vertex_at_place(place: u32, corner: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(leaf_triangles[place + corner].xyz);
}

/// Whether the ray may hit the triangle at a quad.
fn is_candidate(at: u32) -> bool {
    let a = sheared(vertex(at) - shear.origin);
    let b = sheared(vertex(at + 1u) - shear.origin);
    let c = sheared(vertex(at + 2u) - shear.origin);
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    let sum = ((abs(a.x) + abs(a.y)) + (abs(b.x) + abs(b.y))) + (abs(c.x) + abs(c.y));
    let error = shear.apart.x * (sum + shear.apart.y) + TINY;
    return !(min(u, min(v, w)) < -error && max(u, max(v, w)) > error);
}

// part weighed
// `t` and weights of a hit that is certain.
// use shared/triangle/records
// use shared/undecided/found

/// The hit of a triangle in the current instance.
fn weighed_triangle(index: u32, found: Found) -> Hit {
    let corners = array<vec3<f32>, 3>(
        sheared(vertex(found.at) - shear.origin),
        sheared(vertex(found.at + 1u) - shear.origin),
        sheared(vertex(found.at + 2u) - shear.origin),
    );
    let weights = inside(corners);
    if weights.w < 0.0 {
        // The exact kernel interpolates along an edge.
        list(index);
    }
    let z = weights.x * corners[0].z + (weights.y * corners[1].z + weights.z * corners[2].z);
    return Hit(caller_t(guarded_quotient(z, shear.depth)), weights.y, weights.z, found.primitive, found.instance);
}

// choice weights/triangles
// Scenes of triangles.
// use shared/triangle/weighed

fn completed(index: u32, found: Found) -> Hit {
    return weighed_triangle(index, found);
}
