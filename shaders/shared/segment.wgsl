// Round linear segments: the convex hull of two balls, whose surface a ray enters and leaves; twin of crates/trace/src/round_segment.rs, in f32.
//
// # Units
// A segment is tested in units of its size, a power of two: then its axis and radii are below 2, squares are in range, and multiplication by the
// unit is exact. The first end `a` is the thinner one: where it is a tip, numbers near it are small, and so are their roundings. Positions are relative
// to it, from the point of the line that is nearest to the center, so that distance does not cancel: let f be `a` relative to the origin and t the
// parameter of that point; then `t d - f` is a point of the line but for its roundings.
//
// # What is hit
// A point p is in the segment where `|p - s v| <= r_0 + s (r_1 - r_0)` for some s in 0..=1: v leads from end to end. The line enters at the least root of the
// two spheres and of the lateral surface, and leaves at the greatest; see the twin.
//
// # Error
// Let E = 2^-23, M the largest coordinate of the ends relative to the origin plus the greater radius, D = drift.y M + drift.x (shared/level). The ray of the
// CPU differs from the computed one, where it is within M of the origin, by E M in each coordinate for f, 3 E M for the point of the line
// (two roundings of `t d`, which is at most twice M there, and the difference), and D / 2: less than 9 E M + D in length. The CPU's own
// hit is within 2 E M of the surface (`canted_wide`). The roundings in units of the segment are counted at shared/segment/certain and
// are below 256 E of its size. So a point at the entry as computed is within HIT_ERROR of the surface, as for triangles: the quadratic equation
// has terms of v^2 r^2 and v^2 p^2, where p is at most a few sizes from the line, so that rounding moves its value by some 30 E of v^2 r (r + |v|)
// and its root off the surface by as much of |v| + r. Where a steep line passes a tip, whose radius is 0, all terms are as small as the distance of the base from it, which has the rounding of the point of the line.
// use shared/bvh
// use shared/triangle/records

/// A segment in its own units, and the line of the ray.
struct Segment {
    /// From the first end to the point of the line that is nearest to the center.
    base: vec3<f32>,
    /// Scaled `t` of that point.
    base_t: f32,
    /// From the first end to the second.
    axis: vec3<f32>,
    /// The unit, a power of two, and its reciprocal; 0 for a segment without size.
    unit: f32,
    from_unit: f32,
    radii: vec2<f32>,
    /// Largest coordinate of the ends relative to the origin, plus the greater radius; not in units of the segment.
    far_off: f32,
    /// Largest coordinate of the axis, or the greater radius; not in units of the segment.
    size: f32,
    /// Error of points that move; not in units of the segment.
    moved: f32,
    /// Whether the curve leads from the second end to the first.
    is_back: bool,
}

/// Where a line passes through a surface: parameters of the line from the base on, in units of the segment, and positions along the segment.
struct SegmentSpan {
    entry: vec2<f32>,
    exit: vec2<f32>,
    is_hit: bool,
}

/// Distance of a base point from the first end, in units of the segment, up to which the line may be near.
const MOST_APART: f32 = 16.0;

/// Greatest parameter of a root.
const MOST_ROOT: f32 = 64.0;

/// Roundings of a difference of squares, relative.
const SQUARE_ROUNDING: f32 = 8.0 * ROUNDING;

/// The segment at a quad, for the ray of the current instance.
fn segment_at(at: u32) -> Segment {
    let radii = bitcast<vec2<f32>>(leaf_triangles[at + 2u].xy);
    let a = vec4<f32>(bitcast<vec3<f32>>(leaf_triangles[at].xyz), radii.x);
    return segment_of(a, vec4<f32>(bitcast<vec3<f32>>(leaf_triangles[at + 1u].xyz), radii.y), 0.0);
}

/// The segment between two balls, whose numbers err by `moved`.
fn segment_of(a: vec4<f32>, b: vec4<f32>, moved: f32) -> Segment {
    let is_back = a.w > b.w;
    let thin = select(a, b, is_back);
    let thick = select(b, a, is_back);
    let first = thin.xyz - space.origin;
    let second = thick.xyz - space.origin;
    // Ends are exact, or have an error of their own, so their difference has one rounding.
    let axis = thick.xyz - thin.xyz;
    let radius = thick.w;
    let size = max(greatest(axis), radius);
    // Its reciprocal must not underflow.
    let power = min(bitcast<u32>(size) & 0x7f800000u, 0x7e800000u);
    let from_unit = bitcast<f32>(select(0x7f000000u - power, 0u, power == 0u));
    let d = space.direction;
    let base_t = (project(first, d) + 0.5 * project(axis, d)) * reciprocal(project(d, d));
    let base = base_t * d - first;
    let far_off = max(greatest(first), greatest(second)) + radius;
    return Segment(base * from_unit, base_t, axis * from_unit, bitcast<f32>(power), from_unit, vec2<f32>(thin.w, thick.w) * from_unit, far_off, size, moved, is_back);
}

/// Where the line enters and leaves.
fn span_of_segment(segment: Segment) -> SegmentSpan {
    var span = SegmentSpan(vec2<f32>(2.0 * MOST_ROOT, 0.0), vec2<f32>(-2.0 * MOST_ROOT, 0.0), false);
    let d = space.direction;
    if greatest(segment.base) > MOST_APART || segment.unit == 0.0 {
        return span;
    }
    let v = segment.axis;
    let r = segment.radii.x;
    let delta = r - segment.radii.y;
    let d_squared = project(d, d);
    let axis_squared = project(v, v);
    let e = axis_squared - delta * delta;
    let is_cone = e > SQUARE_ROUNDING * axis_squared;
    let across = across_of(d, v);
    let across_squared = project(across, across);
    // A line that is steeper than the surface meets both halves of the cone, whatever is rounded.
    let a = across_squared - delta * delta * d_squared;
    let is_steep = a < 0.0;
    // The point of the line that is nearest to the axis, within the size of the segment, or of a steep line that to the first end.
    var shift = 0.0;
    if is_steep {
        shift = clamp(-project(segment.base, d) * reciprocal(d_squared), -MOST_APART, MOST_APART);
    } else if is_cone && across_squared > SQUARE_ROUNDING * SQUARE_ROUNDING * d_squared * axis_squared {
        shift = clamp(-project(across_of(segment.base, v), across) * reciprocal(across_squared), -MOST_APART, MOST_APART);
    }
    let m = segment.base + shift * d;
    var n_lateral = 0u;
    if is_cone {
        let moment = across_of(m, v);
        let along_m = project(m, v);
        let along_d = project(d, v);
        let b = project(moment, across) - delta * delta * project(m, d) + r * delta * along_d;
        let c = project(moment, moment) - delta * delta * project(m, m) - axis_squared * r * r + 2.0 * r * delta * along_m;
        let square = b * b - a * c;
        if square >= 0.0 || is_steep {
            let root = guarded_root(square);
            let q = select(-root - b, root - b, b < 0.0);
            let roots = vec2<f32>(guarded_ratio(q, a), guarded_ratio(c, q));
            for (var k = 0u; k < 2u; k += 1u) {
                let s = (along_m + roots[k] * along_d - r * delta) * reciprocal(e);
                if abs(roots[k]) < MOST_ROOT && s >= -4.0 * ROUNDING && s <= 1.0 + 4.0 * ROUNDING {
                    add_root(&span, shift + roots[k], clamp(s, 0.0, 1.0));
                    n_lateral += select(1u, 0u, is_steep);
                }
            }
        }
    }
    // The hull is convex: where both points are on the lateral surface, the balls are between them. A steep line meets it once at most, but through
    // an apex both roots are there.
    for (var k = 0u; k < 2u && n_lateral < 2u; k += 1u) {
        let w = m - f32(k) * v;
        let radius = segment.radii[k];
        let nearest = -project(w, d) * reciprocal(d_squared);
        let off = w + nearest * d;
        let distance = guarded_root(project(off, off));
        if distance <= radius {
            let half_chord = guarded_root((radius - distance) * (radius + distance) * reciprocal(d_squared));
            add_root(&span, shift + (nearest - half_chord), f32(k));
            add_root(&span, shift + (nearest + half_chord), f32(k));
        }
    }
    span.is_hit = span.entry.x <= span.exit.x;
    return span;
}

fn add_root(span: ptr<function, SegmentSpan>, root: f32, s: f32) {
    if root < (*span).entry.x {
        (*span).entry = vec2<f32>(root, s);
    }
    if root > (*span).exit.x {
        (*span).exit = vec2<f32>(root, s);
    }
}

/// The position along the curve.
fn along_curve(segment: Segment, s: f32) -> f32 {
    return select(s, 1.0 - s, segment.is_back);
}

/// Scaled `t` of a parameter of the line.
fn t_of_root(segment: Segment, root: f32) -> f32 {
    return segment.base_t + root * segment.unit;
}

fn across_of(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return a.yzx * b.zxy - a.zxy * b.yzx;
}

fn guarded_root(x: f32) -> f32 {
    return sqrt(max(x, 0.0));
}

/// `a / b`, or more than `MOST_ROOT` where the quotient would be.
fn guarded_ratio(a: f32, b: f32) -> f32 {
    if abs(b) < MIN_DIVISOR || abs(a) >= MOST_ROOT * abs(b) {
        return 2.0 * MOST_ROOT;
    }
    return a / b;
}

/// Iterations of the loops of a test, with those in which they end.
const SEGMENT_ITERATIONS: u32 = 6u;

// part leaf
// The segments of a leaf. A hit has `u` along the segment, and as `v` whether the ray leaves it there.
// use shared/triangle/leaf
// use ?exits

/// Tests the segments of a leaf.
fn segment_leaf(word: u32) {
    var at = first_of_leaf(word);
    let n = size_of_leaf(word);
    count_triangles(n);
    iterations += n * (1u + SEGMENT_ITERATIONS) + 1u;
    for (var i = 0u; i < n; i += 1u) {
        consider_segment(at, segment_at(at));
        at += TRIANGLE_QUADS;
    }
}

/// Keeps the hit of a segment if it is the best.
fn consider_segment(at: u32, segment: Segment) {
    let span = span_of_segment(segment);
    if !span.is_hit {
        return;
    }
    tested_place = at;
    var t = t_of_root(segment, span.entry.x);
    var u = along_curve(segment, span.entry.y);
    let number = leaf_triangles[at].w;
    if t >= space.t_min {
        if t > t_max {
            return;
        }
        let hit = Hit(caller_t(t), u, 0.0, number, space.instance);
        if before(hit, best) && accepts(placed(hit)) {
            best = hit;
            t_max = t;
            return;
        }
    }
    t = t_of_root(segment, span.exit.x);
    u = along_curve(segment, span.exit.y);
    if t >= space.t_min && t <= t_max {
        let hit = Hit(caller_t(t), u, 1.0, number, space.instance);
        if before(hit, best) && !is_passed_at_exit(placed(hit)) && accepts(placed(hit)) {
            best = hit;
            t_max = t;
        }
    }
}

// choice exits/kept
// Rays that start in a segment leave it with a hit.

fn is_passed_at_exit(hit: Hit) -> bool {
    return false;
}

// part weighed
// `t` and position along the segment of a hit that is certain.
// use shared/undecided/found

/// The hit of a segment in the current instance.
fn weighed_segment(found: Found, segment: Segment) -> Hit {
    let span = span_of_segment(segment);
    let entry = t_of_root(segment, span.entry.x);
    let is_exit = entry < space.t_min;
    let point = select(span.entry, span.exit, is_exit);
    return Hit(caller_t(t_of_root(segment, point.x)), along_curve(segment, point.y), 0.0, found.primitive, found.instance);
}

// choice weights/curves
// Scenes of triangles and of round segments.
// use shared/triangle/weighed
// use shared/segment/weighed

fn completed(index: u32, found: Found) -> Hit {
    if is_of_curves() {
        return weighed_segment(found, segment_at(found.at));
    }
    return weighed_triangle(index, found);
}

// part certain
// What is certain about the hit of a segment. All lengths are in units of the segment.
//
// # Certificates
// Nothing that guides the search is trusted; what is found is tested, by a few operations whose error is bounded:
//
// * *Inside.* A point p is deeper than g in the segment if for any s in 0..=1 `|p - s v| - (r_0 + s (r_1 - r_0)) < -g`: it is in a ball of the segment.
// * *Outside.* It is farther than g from the segment if for any unit vector n `n p - max(r_0, n v + r_1) > g`: a plane separates them.
// * *Miss.* All points of a line are, if a plane does that for one and n d is so small that it does for all that are near.
//
// The segment is convex. So if the ray is outside at t_lo and inside at t_hi > t_lo, it enters between, for the first time; the same holds
// backwards where it leaves. The CPU's ray is within g of the computed one, and its hit within g of the surface, so it enters there, too.
//
// # Bounds
// g is the sum of the error of the ray, 9 E M + D, that of the CPU's hit, 2 E M, and roundings. In units of the segment its size is below 2, so a point p at the
// surface is within 5.5 of the first end, and roots are at most 40. As base + root * d it has an error of 40 E + 5.5 E in each coordinate, below 80 E in length. For
// *inside*, `p - s v` adds 17 E, its length 8 E, the radius 6 E; for *outside*, n is a unit vector but for 8 E, which with p and v costs 72 E, the products 27 E.
// Both are below 256 E. For *miss*, n d has an error of 12 E, and of points at the surface the root is at most 2 |base| + 8.
//
// # Interval of t
// `t` has four roundings relative to the distance, which is at most 2 M.
// use shared/segment

/// Error of the ray relative to M, and of all else relative to the size of the segment.
const RAY_ROUNDING: f32 = 12.0 * ROUNDING;
const LOCAL_ROUNDING: f32 = 256.0 * ROUNDING;

/// Roundings of a product of a unit vector with the direction.
const PLANE_ROUNDING: f32 = 16.0 * ROUNDING;

/// Keeps what is certain about the hit of a segment, that at a quad.
fn decide_segment(at: u32, segment: Segment) {
    let drift = space.drift.y * segment.far_off + space.drift.x;
    let error = BOUND_SCALE * (RAY_ROUNDING * segment.far_off + segment.moved + drift + TINY);
    iterations += SEGMENT_ITERATIONS + 8u;
    let outer = abs(error) + LOCAL_ROUNDING * segment.size;
    // All points of the segment are within three sizes of the first end, and the line is within one size of its nearest point to it.
    if greatest(segment.base) * segment.unit > 8.0 * segment.size + 4.0 * outer {
        return;
    }
    // The segment is within two sizes of its middle, which is nearest at the base.
    let reach = 2.75 * segment.size + 2.0 * outer;
    let rounding = 8.0 * ROUNDING * (segment.far_off + segment.size) + TINY;
    let first = segment.base_t - reach - rounding;
    let last = segment.base_t + reach + rounding;
    if first > limit() || last < space.t_min {
        return;
    }
    let g = error * segment.from_unit + BOUND_SCALE * LOCAL_ROUNDING;
    let is_usable = segment.unit > 0.0 && outer < segment.size;
    if is_usable && is_missed(segment, g) {
        return;
    }
    let span = span_of_segment(segment);
    if is_usable && span.is_hit {
        let middle_root = 0.5 * (span.entry.x + span.exit.x);
        let middle = vec2<f32>(middle_root, 0.5 * (span.entry.y + span.exit.y));
        let depth = -above_ball(segment, middle);
        if depth > 1.25 * g {
            let entry = certain_entry(segment, span.entry, middle, depth, g, 1.0);
            let exit = certain_entry(segment, span.exit, middle, depth, g, -1.0);
            let enters = vec2<f32>(t_of_root(segment, entry.x) - rounding, t_of_root(segment, entry.y) + rounding);
            let leaves = vec2<f32>(t_of_root(segment, exit.y) - rounding, t_of_root(segment, exit.x) + rounding);
            if entry.x <= entry.y && enters.x >= space.t_min {
                keep(0.5 * (enters.x + enters.y), 0.5 * (enters.y - enters.x) + rounding, at);
                return;
            }
            // The ray starts inside.
            if entry.x <= entry.y && exit.y <= exit.x && enters.y < space.t_min {
                keep(0.5 * (leaves.x + leaves.y), 0.5 * (leaves.y - leaves.x) + rounding, at);
                return;
            }
        }
    }
    doubt = min(doubt, comparable(max(first, 0.0)));
}

/// Distance of a point of the line from a ball of the segment, by the root of one and the position of the other.
fn above_ball(segment: Segment, root_and_s: vec2<f32>) -> f32 {
    let s = root_and_s.y;
    let off = segment.base + root_and_s.x * space.direction - s * segment.axis;
    return guarded_root(project(off, off)) - (segment.radii.x + s * (segment.radii.y - segment.radii.x));
}

/// How far a plane with this unit normal, which touches the segment, is below a point.
fn above_plane(segment: Segment, point: vec3<f32>, normal: vec3<f32>) -> f32 {
    return project(normal, point) - max(segment.radii.x, project(normal, segment.axis) + segment.radii.y);
}

/// An interval of roots in which the ray enters: outside, then inside; reversed if there is none. With `side` -1 where it leaves, from the far end.
fn certain_entry(segment: Segment, entry: vec2<f32>, middle: vec2<f32>, depth: f32, g: f32, side: f32) -> vec2<f32> {
    let none = vec2<f32>(side, -side);
    // Between the entry and the middle, at twice the error in depth.
    let share = clamp(2.0 * g * reciprocal(depth), 0.0, 1.0);
    let inner = entry + share * (middle - entry);
    if above_ball(segment, inner) >= -g {
        return none;
    }
    let point = segment.base + entry.x * space.direction;
    let normal = normal_at(segment, point, entry.y);
    let speed = -side * project(normal, space.direction);
    let step = 2.0 * g * reciprocal(max(speed, 1e-6));
    if speed <= 0.0 || step > 1.0 {
        return none;
    }
    let outer = entry.x - side * step;
    let is_outside = above_plane(segment, segment.base + outer * space.direction, normal) > g;
    return select(none, vec2<f32>(outer, inner.x), is_outside);
}

/// The unit normal of the surface at a point of it whose ball is at `s`.
fn normal_at(segment: Segment, point: vec3<f32>, s: f32) -> vec3<f32> {
    if s <= 0.0 || s >= 1.0 {
        return guarded_unit(point - s * segment.axis);
    }
    // Twice, because a thin segment is much longer than the distance from its axis.
    let v = segment.axis;
    let inverse = reciprocal(project(v, v));
    var off = point - (project(point, v) * inverse) * v;
    off -= (project(off, v) * inverse) * v;
    var normal = guarded_unit(off);
    normal -= (project(normal, v) * inverse) * v;
    return on_cone(segment, normal, v, inverse);
}

/// The unit normal in the plane of a unit vector across a vector `v` with this inverse square, and of `v`, at which the planes of a cone touch both balls.
fn on_cone(segment: Segment, across: vec3<f32>, v: vec3<f32>, inverse: f32) -> vec3<f32> {
    let delta = segment.radii.x - segment.radii.y;
    return guarded_unit(guarded_root(1.0 - delta * delta * inverse) * across + (delta * inverse) * v);
}

/// Whether the line certainly passes the segment: planes along the line through the nearest points of both balls, and one that touches both.
fn is_missed(segment: Segment, g: f32) -> bool {
    let d = space.direction;
    let inverse = reciprocal(project(d, d));
    let far = 2.0 * greatest(segment.base) + 8.0;
    let first = segment.base - (project(segment.base, d) * inverse) * d;
    if is_beside(segment, guarded_unit(first), far, g) {
        return true;
    }
    let v = segment.axis - (project(segment.axis, d) * inverse) * d;
    if is_beside(segment, guarded_unit(first - v), far, g) {
        return true;
    }
    let across = guarded_unit(across_of(d, v));
    let side = select(1.0, -1.0, project(across, segment.base) < 0.0);
    return is_beside(segment, on_cone(segment, side * across, v, reciprocal(project(v, v))), far, g);
}

/// Whether a plane with this unit normal separates the line, as far as it is near, from the segment.
fn is_beside(segment: Segment, normal: vec3<f32>, far: f32, g: f32) -> bool {
    let slope = abs(project(normal, space.direction)) + PLANE_ROUNDING;
    return above_plane(segment, segment.base, normal) - slope * far > g;
}

/// The unit vector along `v`; zero for less than 2^-60.
fn guarded_unit(v: vec3<f32>) -> vec3<f32> {
    let square = project(v, v);
    return select(v * inverseSqrt(max(square, 1e-36)), vec3<f32>(0.0), square < 1e-36);
}
