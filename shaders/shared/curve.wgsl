// Curves of every kind: round segments, spheres, round cubic curves, and straight and cubic ribbons, whose points and radii may move while the shutter is open; twin of
// `round_segment`, `round_cubic`, `cubic_part`, `ribbon`, `ribbon_cubic` in crates/trace/src and of `Moving` in crates/wide, in f32.
//
// # Records
// A place of a leaf has three quads, as for triangles. For a segment that does not move they are those of shared/segment. For all others the last word of the
// first is the number of the primitive, that of the second its kind, and that of the third the first quad of its rows, relative to the first of the BVH: control
// balls, each a center and a radius, then for ribbons the point `next`. What moves has the rows at shutter closing after those at opening.
//
// # Frame and units
// A curve is tested in the frame of the ray, whose third axis is the line (Duff et al. 2017), relative to the point of the line next to the middle of its control points, and in units of its size, a power of two.
// There the ball at the parameter `u` has the center `(p, z)` with `p` across the line, and the radius `r`. A straight curve is a cubic one, with control balls at
// thirds.
//
// # Parts
// Of most curves the line meets the balls of one interval of parameters only, where `z - w` with `w² = r² - p²` is convex, and the square of the distance, too. The conditions are
// those of `cubic_part`. Curves for which they do not hold are halved, MAX_LEVEL times; control values of a part are the polar form of the whole at its ends, so nothing is stored.
// What is left then is undecided, or for a caller that takes the answer of single precision the ball of the middle of the part.
//
// # Error
// Let E = 2^-23, M the largest coordinate of control points relative to the origin plus the greatest radius, D = drift.y M + drift.x (shared/level). As for segments, the
// ray of the CPU is within 9 E M + D of the computed one. The CPU's hit is within 5 E M of the surface (`canted_wide`), and where it replaces parts by segments they
// deviate from the curve by 2 E of its size. A coordinate that moves errs by two roundings of its way, one of its own, and the CPU's: by less than 6 E of the largest at
// any time, and a point by 11 E. In units of the curve its size is below 2, so control points are within 9 of the base, if the line is near. Each coordinate
// errs by 9 E in a difference, and by 13 E of 9 in the product with an axis, which errs by 10 E: 9 E and 117 E, in length less than 230 E. What is computed from
// the control points at a parameter has six roundings of terms whose sum is below 9, and derivatives of ones below 3 * 7: both are below VALUE_ERROR, which
// is added where it counts. LOCAL_ERROR covers the rest of both.
// So each ball of the CPU's curve, seen from the CPU's ray, is within `g`, the sum of all these, of the computed one, and has its radius.
//
// * *Inside.* If the line meets the computed ball of the radius `r - g`, the CPU's ray is in the solid there.
// * *Outside.* The CPU's solid is in that of the balls of the radius `r + g`. With `m`, at most half the second derivative of `p² - (r + g)²` less R|z''|, `z - w` exceeds its least
//   value by at most `(z - w)'² R / (2 m)`, and `p² - (r + g)²` its own by `(p p' - r r')² / m`; see `cubic_part`. The control values of derivatives err by 6 g, those of second
//   ones by 24 g.
// use shared/bvh
// use shared/triangle/records
// use shared/segment
// use shared/time/ray_time
// use shared/invocation/iterations
// const MAX_ITERATIONS

/// Bits of a kind. One that is not 0 has SWEPT.
const CUBIC: u32 = 1u;
const RIBBON: u32 = 2u;
const MOVING: u32 = 4u;
const SWEPT: u32 = 8u;
const BALL: u32 = 16u;

/// Halvings of a curve at most.
const MAX_LEVEL: u32 = 6u;

/// Steps of a search for a least value.
const SEARCH_STEPS: u32 = 12u;

/// Error of the ray and of the CPU's hit relative to M, of positions that move relative to their coordinates, and of all else relative to the size.
const CURVE_RAY_ERROR: f32 = 15.0 * ROUNDING;
const MOVING_ERROR: f32 = 11.0 * ROUNDING;
const LOCAL_ERROR: f32 = 384.0 * ROUNDING;

/// Error of a value or derivative of a curve, relative to its size.
const VALUE_ERROR: f32 = 128.0 * ROUNDING;

/// Beyond all positions along the line in units of the curve.
const BEYOND_CURVES: f32 = 1e6;

/// A curve in the frame of the ray.
struct Curve {
    kind: u32,
    /// Control balls: across the line, along it, radius.
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    d: vec4<f32>,
    /// From the end of a ribbon towards the next one, across the line; whether there is one.
    next: vec2<f32>,
    is_joined: bool,
    /// Scaled `t` of the base, and per unit along the line.
    base_t: f32,
    step_t: f32,
    /// The unit, and its reciprocal; 0 for a curve without size.
    unit: f32,
    from_unit: f32,
    /// Largest coordinate relative to the origin plus the greatest radius; that of control points in motion at any time. Not in units of the curve.
    far_off: f32,
    moved: f32,
    /// Roundings of a position along the line, in units of the curve.
    margin: f32,
    /// Largest coordinate relative to the first control point, or radius. Not in units of the curve.
    size: f32,
    /// Whether the line is so near that the units are in range.
    is_near: bool,
}

/// What the ray meets first, and from where on it is in doubt. In units of the curve, along the line.
struct CurveEvent {
    /// An interval that contains where it is; both BEYOND_CURVES if there is nothing.
    first: f32,
    last: f32,
    u: f32,
    v: f32,
    is_exit: bool,
    doubt: f32,
}

/// The balls of a part, and what bounds them.
struct CurvePart {
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    d: vec4<f32>,
    /// The chord across the line.
    chord: vec2<f32>,
    /// Its length.
    chord_length: f32,
    /// The greatest radius, with the error.
    radius: f32,
    /// `m`, for the parameter of the part.
    convexity: f32,
    /// Greatest second derivative across the line and along it.
    across: f32,
    bend: f32,
    /// Whether the line passes the part, or else whether it meets balls of one interval only.
    is_passed: bool,
    is_single: bool,
}

/// Largest number of the rows of a curve that moves.
var<private> reach_in_motion: f32;

/// Row `k` of `n` at a quad, at the time of the ray.
fn row_of_curve(at: u32, k: u32, n: u32, kind: u32) -> vec4<f32> {
    let open = bitcast<vec4<f32>>(leaf_triangles[at + k]);
    if (kind & MOVING) == 0u {
        return open;
    }
    let close = bitcast<vec4<f32>>(leaf_triangles[at + k + n]);
    let farthest = max(abs(open), abs(close));
    reach_in_motion = max(reach_in_motion, max(max(farthest.x, farthest.y), max(farthest.z, farthest.w)));
    return clamp(open + ray_time * (close - open), min(open, close), max(open, close));
}

/// First quad of the rows of the curve at a place.
fn rows_of_curve(at: u32) -> u32 {
    return space.first_triangle + leaf_triangles[at + 2u].w;
}

/// The curve at a place, for the ray of the current instance.
fn curve_at(at: u32, kind: u32) -> Curve {
    var curve: Curve;
    curve.kind = kind;
    reach_in_motion = 0.0;
    let rows = rows_of_curve(at);
    let is_cubic = (kind & CUBIC) != 0u;
    let n_balls = select(2u, 4u, is_cubic);
    let is_ribbon = (kind & RIBBON) != 0u;
    let n = n_balls + u32(is_ribbon);
    let a = row_of_curve(rows, 0u, n, kind);
    let b = row_of_curve(rows, 1u, n, kind);
    var c = b;
    var d = b;
    if is_cubic {
        c = row_of_curve(rows, 2u, n, kind);
        d = row_of_curve(rows, 3u, n, kind);
    }
    // Points are exact, or those that move have an error of their own, so differences have one rounding.
    var to_b = b - a;
    var to_c = c - a;
    let to_d = d - a;
    if !is_cubic {
        to_b = to_d * (1.0 / 3.0);
        to_c = to_d * (2.0 / 3.0);
    }
    let radii = vec4<f32>(a.w, a.w + to_b.w, a.w + to_c.w, d.w);
    let radius = max(max(radii.x, radii.y), max(radii.z, radii.w));
    let size = max(max(greatest(to_b.xyz), greatest(to_c.xyz)), max(greatest(to_d.xyz), radius));
    // Its reciprocal must not underflow.
    let power = min(bitcast<u32>(size) & 0x7f800000u, 0x7e800000u);
    let from_unit = bitcast<f32>(select(0x7f000000u - power, 0u, power == 0u));
    let first = a.xyz - space.origin;
    let direction = space.direction;
    let middle = 0.25 * (to_b.xyz + to_c.xyz + to_d.xyz);
    let base_t = (project(first, direction) + project(middle, direction)) * reciprocal(project(direction, direction));
    let base = base_t * direction - first;
    curve.size = size;
    curve.unit = bitcast<f32>(power);
    curve.from_unit = from_unit;
    curve.far_off = max(greatest(first), greatest(d.xyz - space.origin)) + 3.0 * size;
    curve.moved = reach_in_motion;
    curve.base_t = base_t;
    // In units of the curve, all points are within 2.75 of the first one, and the middle is within 1.8.
    curve.is_near = power != 0u && greatest(base) * from_unit <= 16.0;
    let unit_length = guarded_inverse_root(project(direction, direction));
    curve.step_t = unit_length * curve.unit;
    curve.margin = 2.0 * from_unit * (8.0 * ROUNDING * (curve.far_off + size) + TINY);
    if is_ribbon {
        let end = rows + n_balls - 1u;
        let close = select(0u, n, (kind & MOVING) != 0u);
        curve.is_joined = any(bitcast<vec3<f32>>(leaf_triangles[end].xyz) != bitcast<vec3<f32>>(leaf_triangles[end + 1u].xyz))
            || any(bitcast<vec3<f32>>(leaf_triangles[end + close].xyz) != bitcast<vec3<f32>>(leaf_triangles[end + close + 1u].xyz));
    }
    // The axes of the frame.
    let axis = unit_length * direction;
    let side = select(1.0, -1.0, axis.z < 0.0);
    let slant = -reciprocal(side + axis.z);
    let skew = axis.x * axis.y * slant;
    let first_axis = vec3<f32>(1.0 + side * axis.x * axis.x * slant, side * skew, -side * axis.x);
    let second_axis = vec3<f32>(skew, side + axis.y * axis.y * slant, -axis.y);
    let local = mat4x3<f32>(-base * from_unit, (to_b.xyz - base) * from_unit, (to_c.xyz - base) * from_unit, (to_d.xyz - base) * from_unit);
    let small = radii * from_unit;
    curve.a = vec4<f32>(project(first_axis, local[0]), project(second_axis, local[0]), project(axis, local[0]), small.x);
    curve.b = vec4<f32>(project(first_axis, local[1]), project(second_axis, local[1]), project(axis, local[1]), small.y);
    curve.c = vec4<f32>(project(first_axis, local[2]), project(second_axis, local[2]), project(axis, local[2]), small.z);
    curve.d = vec4<f32>(project(first_axis, local[3]), project(second_axis, local[3]), project(axis, local[3]), small.w);
    if is_ribbon {
        let next = row_of_curve(rows, n_balls, n, kind).xyz;
        // A direction is enough, so its length is bounded.
        let onward = next - d.xyz;
        let along = onward * min(from_unit, reciprocal(greatest(onward)));
        curve.next = vec2<f32>(project(first_axis, along), project(second_axis, along));
    }
    return curve;
}

/// Whether a curve is a round segment: one that does not move, one with rows, or a sphere, which has one row.
fn is_segment(kind: u32) -> bool {
    return (kind & (CUBIC | RIBBON)) == 0u;
}

/// The round segment at a place, of any such kind.
fn segment_of_kind(at: u32, kind: u32) -> Segment {
    if kind == 0u {
        return segment_at(at);
    }
    let rows = rows_of_curve(at);
    reach_in_motion = 0.0;
    let n = select(2u, 1u, (kind & BALL) != 0u);
    let a = row_of_curve(rows, 0u, n, kind);
    let b = row_of_curve(rows, n - 1u, n, kind);
    return segment_of(a, b, MOVING_ERROR * reach_in_motion);
}

/// How far each ball of the CPU may be from the computed one, in units of the curve. `scale` is BOUND_SCALE of shared/certain.
fn error_of_curve(curve: Curve, scale: f32) -> f32 {
    let drift = space.drift.y * curve.far_off + space.drift.x;
    let of_ray = CURVE_RAY_ERROR * curve.far_off + MOVING_ERROR * curve.moved + drift + TINY;
    return scale * (of_ray * curve.from_unit + LOCAL_ERROR);
}

/// The ball at a parameter.
fn ball_at(curve: Curve, u: f32) -> vec4<f32> {
    let v = 1.0 - u;
    return v * v * (v * curve.a + (3.0 * u) * curve.b) + u * u * ((3.0 * v) * curve.c + u * curve.d);
}

/// Its derivative.
fn slope_at(curve: Curve, u: f32) -> vec4<f32> {
    let v = 1.0 - u;
    return 3.0 * (v * v * (curve.b - curve.a) + (2.0 * u * v) * (curve.c - curve.b) + u * u * (curve.d - curve.c));
}

/// The polar form at three parameters.
fn polar(curve: Curve, x: f32, y: f32, z: f32) -> vec4<f32> {
    let ab = mix(curve.a, curve.b, vec4<f32>(x));
    let bc = mix(curve.b, curve.c, vec4<f32>(x));
    let cd = mix(curve.c, curve.d, vec4<f32>(x));
    return mix(mix(ab, bc, vec4<f32>(y)), mix(bc, cd, vec4<f32>(y)), vec4<f32>(z));
}

fn cross_2d(a: vec2<f32>, b: vec2<f32>) -> f32 {
    return a.x * b.y - a.y * b.x;
}

fn dot_across(a: vec2<f32>, b: vec2<f32>) -> f32 {
    return a.x * b.x + a.y * b.y;
}

fn guarded_inverse_root(x: f32) -> f32 {
    return inverseSqrt(max(x, 1e-36));
}

/// Whether all values are beyond a distance, on one side.
fn are_beyond(low: f32, high: f32, distance: f32) -> bool {
    return low > distance || high < -distance;
}

/// The part between two parameters, of which `g` is the error of balls.
fn part_of_curve(curve: Curve, from_u: f32, to_u: f32, g: f32) -> CurvePart {
    var part: CurvePart;
    part.a = polar(curve, from_u, from_u, from_u);
    part.b = polar(curve, from_u, from_u, to_u);
    part.c = polar(curve, from_u, to_u, to_u);
    part.d = polar(curve, to_u, to_u, to_u);
    part.radius = max(max(part.a.w, part.b.w), max(part.c.w, part.d.w)) + g;
    part.chord = part.d.xy - part.a.xy;
    let square = dot_across(part.chord, part.chord);
    part.chord_length = guarded_root(square);
    if square < 1e-12 {
        // A point, or seen along its tangents.
        let extent = max(max(length(part.b.xy - part.a.xy), length(part.c.xy - part.a.xy)), part.chord_length);
        part.is_passed = length(part.a.xy) - extent > part.radius;
        return part;
    }
    let direction = part.chord * reciprocal(part.chord_length);
    // The inner two Bernstein polynomials have a sum of at most 3/4.
    let offset = cross_2d(direction, part.a.xy);
    let bulges = vec2<f32>(cross_2d(direction, part.b.xy) - offset, cross_2d(direction, part.c.xy) - offset);
    let low = offset + 0.75 * min(min(bulges.x, bulges.y), 0.0);
    let high = offset + 0.75 * max(max(bulges.x, bulges.y), 0.0);
    let at = vec4<f32>(dot_across(direction, part.a.xy), dot_across(direction, part.b.xy), dot_across(direction, part.c.xy), dot_across(direction, part.d.xy));
    part.is_passed = are_beyond(low, high, part.radius)
        || are_beyond(min(min(at.x, at.y), min(at.z, at.w)), max(max(at.x, at.y), max(at.z, at.w)), part.radius);
    let least = 3.0 * min(at.y - at.x, min(at.z - at.y, at.w - at.z)) - 6.0 * g;
    let most = 3.0 * max(abs(bulges.x), max(abs(bulges.y - bulges.x), abs(bulges.y))) + 6.0 * g;
    let p = part.a - 2.0 * part.b + part.c;
    let q = part.b - 2.0 * part.c + part.d;
    part.across = 6.0 * max(length(p.xy), length(q.xy)) + 24.0 * g;
    part.bend = 6.0 * max(abs(p.z), abs(q.z)) + 24.0 * g;
    var bend = 2.25 * part.radius * part.across;
    if (curve.kind & RIBBON) == 0u {
        let slope = 3.0 * max(abs(part.b.w - part.a.w), max(abs(part.c.w - part.b.w), abs(part.d.w - part.c.w))) + 6.0 * g;
        bend += slope * slope + part.radius * (part.bend + 6.0 * max(abs(p.w), abs(q.w)) + 24.0 * g);
    }
    part.is_single = least > 0.0 && 2.0 * most <= least && least * least > 1.25 * bend;
    part.convexity = least * least - bend;
    return part;
}

/// What a search finds in a part.
struct LeastEntry {
    u: f32,
    /// An interval that contains the least `sign * z - w`. The first is BEYOND_CURVES where the line passes the part, the last where it may.
    first: f32,
    last: f32,
}

/// The parameter of a part at which `sign * z - w` is least, or the distance where the line meets no ball. With `is_flat` always the distance.
fn least_of_part(curve: Curve, part: CurvePart, from_u: f32, width: f32, sign: f32, is_flat: bool) -> f32 {
    let along_a = dot_across(part.chord, part.a.xy);
    var u = clamp(-along_a * reciprocal(part.chord_length * part.chord_length), 0.0, 1.0);
    var low = 0.0;
    var high = 1.0;
    // One in which the loop ends.
    iterations += 1u;
    for (var i = 0u; i < SEARCH_STEPS; i += 1u) {
        iterations += 1u;
        let ball = ball_at(curve, from_u + width * u);
        let first = width * slope_at(curve, from_u + width * u);
        let at = from_u + width * u;
        let second = (6.0 * width * width) * mix(curve.a - 2.0 * curve.b + curve.c, curve.b - 2.0 * curve.c + curve.d, vec4<f32>(at));
        let radius = select(ball.w, 0.0, is_flat);
        let narrowing = select(first.w, 0.0, is_flat);
        let p_square = dot_across(ball.xy, ball.xy);
        let q = p_square - radius * radius;
        let half = dot_across(ball.xy, first.xy) - radius * narrowing;
        let turn = dot_across(first.xy, first.xy) + dot_across(ball.xy, second.xy)
            - select(narrowing * narrowing + radius * second.w, 0.0, is_flat);
        let slope = sign * first.z;
        let along = dot_across(part.chord, ball.xy);
        var is_before = along > 0.0;
        var next = u - along * reciprocal(dot_across(part.chord, first.xy));
        if q <= 0.0 && !is_flat {
            let w = guarded_root(-q);
            is_before = slope * w + half > 0.0;
            next = u - (half + slope * guarded_root((half * half - q * turn) * reciprocal(turn + slope * slope))) * reciprocal(turn);
        } else if abs(along) <= part.radius * part.chord_length {
            is_before = half > 0.0;
            let depth = select(guarded_root((half * half - q * turn) * reciprocal(turn + slope * slope)), 0.0, is_flat);
            next = u - (half + slope * depth) * reciprocal(turn);
        }
        if (u == 0.0 && is_before) || (u == 1.0 && !is_before) {
            break;
        }
        if is_before {
            high = u;
        } else {
            low = u;
        }
        next = clamp(next, 0.0, 1.0);
        if !(next >= low && next <= high) || i > 8u {
            next = 0.5 * (low + high);
        }
        if abs(next - u) <= 2.0 * ROUNDING {
            break;
        }
        u = next;
    }
    return u;
}

/// Where the line enters a single part of a tube whose least value is at a parameter of the part, or with `sign` -1 the negative of where it leaves.
fn entry_of_part(curve: Curve, part: CurvePart, from_u: f32, width: f32, local: f32, sign: f32, g: f32) -> LeastEntry {
    let u = from_u + width * local;
    var found = LeastEntry(u, BEYOND_CURVES, BEYOND_CURVES);
    let ball = ball_at(curve, u);
    let slope = width * slope_at(curve, u);
    let distance = length(ball.xy);
    let z = sign * ball.z;
    let inner = ball.w - g;
    if inner > distance {
        found.last = z - guarded_root((inner - distance) * (inner + distance));
    }
    if g == 0.0 {
        // The answer of single precision.
        found.first = found.last;
        return found;
    }
    found.last += curve.margin;
    let outer = ball.w + g;
    let size = distance + outer;
    let speed = length(slope.xy) + abs(slope.w);
    let half = dot_across(ball.xy, slope.xy) - outer * slope.w;
    let half_error = VALUE_ERROR * (size + speed);
    let least = min(min(sign * part.a.z, sign * part.b.z), min(sign * part.c.z, sign * part.d.z)) - part.radius - curve.margin;
    if distance - VALUE_ERROR > outer {
        let q = (distance - VALUE_ERROR - outer) * (distance - VALUE_ERROR + outer);
        let off = abs(half) + half_error;
        // The region where the square of the distance is convex.
        let is_in_region = abs(dot_across(part.chord, ball.xy)) <= part.radius * part.chord_length;
        let is_missed = distance > 2.25 * part.radius || q * part.convexity > off * off;
        if is_in_region && (is_missed || local == 0.0 && half > half_error || local == 1.0 && half < -half_error) {
            return found;
        }
        found.first = least;
        found.last = BEYOND_CURVES;
        return found;
    }
    found.first = least;
    let square = (outer - distance) * (outer + distance);
    if square <= 8.0 * VALUE_ERROR * size {
        // It grazes.
        return found;
    }
    let near = max(distance - VALUE_ERROR, 0.0);
    let far = outer + VALUE_ERROR;
    let w = guarded_root((far - near) * (far + near));
    // The derivative, and its error.
    let inverse = guarded_inverse_root(square);
    let rate = sign * slope.z + half * inverse;
    let rate_error = VALUE_ERROR + inverse * (half_error + abs(half) * (2.0 * VALUE_ERROR * size) * (inverse * inverse));
    let is_at_end = local == 0.0 && rate > rate_error || local == 1.0 && rate < -rate_error;
    let off = abs(rate) + rate_error;
    let gap = select(off * off * part.radius * reciprocal(2.0 * part.convexity), 0.0, is_at_end);
    found.first = max(z - w - gap - VALUE_ERROR - curve.margin, least);
    return found;
}

/// The first event of the ray from the position `start` along the line on, and up to `limit`. `g` is the error of balls; with 0 the answer is that of single precision.
fn event_of_curve(curve: Curve, start: f32, limit: f32, g: f32) -> CurveEvent {
    var event = CurveEvent(BEYOND_CURVES, BEYOND_CURVES, 0.0, 0.0, false, BEYOND_CURVES);
    var exit = LeastEntry(0.0, BEYOND_CURVES, -BEYOND_CURVES);
    let is_ribbon = (curve.kind & RIBBON) != 0u;
    var level = 0u;
    var place = 0u;
    loop {
        iterations += 1u;
        if iterations > MAX_ITERATIONS {
            // Drivers that end loops early leave room for one part. The traversal stops next.
            event.doubt = min(event.doubt, start);
            break;
        }
        let width = reciprocal(f32(1u << level));
        let from_u = f32(place) * width;
        let part = part_of_curve(curve, from_u, from_u + width, abs(g));
        let low = min(min(part.a.z, part.b.z), min(part.c.z, part.d.z)) - part.radius - curve.margin;
        let high = max(max(part.a.z, part.b.z), max(part.c.z, part.d.z)) + part.radius + curve.margin;
        let is_skipped = part.is_passed || high < start || low > min(limit, event.last);
        if !is_skipped && !part.is_single && level < MAX_LEVEL {
            level += 1u;
            place *= 2u;
            continue;
        }
        if !is_skipped {
            if !part.is_single {
                add_unknown(&event, curve, from_u + 0.5 * width, vec2<f32>(max(low, start), start), g);
            } else {
                add_single(&event, &exit, curve, part, vec2<f32>(from_u, width), start, g);
            }
        }
        // The next part, of the level of the last halving that has one.
        place += 1u;
        let n_up = min(countTrailingZeros(place), level);
        place = place >> n_up;
        level -= n_up;
        if level == 0u {
            break;
        }
    }
    if is_ribbon {
        add_wedge(&event, curve, start, g);
    }
    // The ray starts inside: entries before it leaves are inside as well.
    if exit.last > -BEYOND_CURVES {
        if g == 0.0 || (event.first > exit.last && exit.first >= start && event.doubt > exit.last) {
            event = CurveEvent(exit.first, exit.last, exit.u, 0.0, true, event.doubt);
        } else {
            event.doubt = min(event.doubt, start);
        }
    }
    return event;
}

/// A part of which nothing is known but that it begins at `low`.
fn add_unknown(event: ptr<function, CurveEvent>, curve: Curve, u: f32, low_and_start: vec2<f32>, g: f32) {
    (*event).doubt = min((*event).doubt, low_and_start.x);
    if g != 0.0 {
        return;
    }
    let ball = ball_at(curve, u);
    let distance = length(ball.xy);
    if distance > ball.w {
        return;
    }
    let w = select(guarded_root((ball.w - distance) * (ball.w + distance)), 0.0, (curve.kind & RIBBON) != 0u);
    let z = ball.z - w;
    if z >= low_and_start.y && z < (*event).last {
        (*event).first = z;
        (*event).last = z;
        (*event).u = u;
        (*event).v = 0.5;
    }
}

/// What the ray meets of a single part.
fn add_single(
    event: ptr<function, CurveEvent>, exit: ptr<function, LeastEntry>, curve: Curve, part: CurvePart, range: vec2<f32>, start: f32, g: f32
) {
    let is_ribbon = (curve.kind & RIBBON) != 0u;
    var entry = LeastEntry(0.0, BEYOND_CURVES, BEYOND_CURVES);
    // One call site, as the search is long. One iteration in which the loop ends.
    iterations += 1u;
    for (var pass_number = 0u; pass_number < 2u; pass_number += 1u) {
        iterations += 1u;
        let sign = select(1.0, -1.0, pass_number == 1u);
        let local = least_of_part(curve, part, range.x, range.y, sign, is_ribbon);
        if is_ribbon {
            add_ribbon(event, curve, part, range, local, start, g);
            return;
        }
        let found = entry_of_part(curve, part, range.x, range.y, local, sign, g);
        if pass_number == 1u {
            add_exit(event, exit, entry, found, range.y < 1.0, start);
        } else if found.first >= BEYOND_CURVES {
            return;
        } else if found.first >= start {
            add_entry(event, found);
            return;
        }
        entry = found;
    }
}

/// Adds the entry into a part of a tube.
fn add_entry(event: ptr<function, CurveEvent>, entry: LeastEntry) {
    if entry.last >= BEYOND_CURVES {
        (*event).doubt = min((*event).doubt, entry.first);
        return;
    }
    // Of two that overlap, both are balls that the ray may enter first.
    if entry.last < (*event).last {
        (*event).u = entry.u;
        (*event).last = entry.last;
    }
    (*event).first = min((*event).first, entry.first);
}

/// Adds where the ray leaves a part of a tube in which it starts.
fn add_exit(event: ptr<function, CurveEvent>, exit: ptr<function, LeastEntry>, entry: LeastEntry, leaving: LeastEntry, is_part: bool, start: f32) {
    if leaving.first >= BEYOND_CURVES || -leaving.first < start {
        // It ends before the ray starts.
        return;
    }
    if entry.last >= start || leaving.last >= BEYOND_CURVES || -leaving.last <= start || is_part {
        // Of several parts the solid is a union, whose end takes more than their ends.
        (*event).doubt = min((*event).doubt, start);
    }
    if entry.last < start && leaving.last < BEYOND_CURVES && -leaving.last > start && -leaving.first > (*exit).last {
        *exit = LeastEntry(leaving.u, -leaving.last, -leaving.first);
    }
}

/// Adds a hit of a ribbon that is between two positions.
fn add_ribbon_hit(event: ptr<function, CurveEvent>, span: vec2<f32>, start: f32, u: f32, v: f32) {
    if span.y < start || span.x > (*event).last {
        return;
    }
    if span.x < start {
        (*event).doubt = min((*event).doubt, start);
        return;
    }
    if span.y >= (*event).first && (*event).first < BEYOND_CURVES {
        (*event).doubt = min((*event).doubt, min(span.x, (*event).first));
        if span.x > (*event).first {
            return;
        }
    }
    (*event).first = span.x;
    (*event).last = span.y;
    (*event).u = u;
    (*event).v = v;
}

/// Position across a ribbon, from 0 to 1.
fn across_ribbon(ball: vec4<f32>, tangent: vec2<f32>) -> f32 {
    let breadth = ball.w * length(tangent);
    return clamp(0.5 + 0.5 * (cross_2d(ball.xy, tangent) * reciprocal(breadth)), 0.0, 1.0);
}

/// The minimum of the distance in a single part of a ribbon, at a parameter of the part, if it is a hit.
fn add_ribbon(event: ptr<function, CurveEvent>, curve: Curve, part: CurvePart, range: vec2<f32>, local: f32, start: f32, g: f32) {
    let u = range.x + range.y * local;
    let ball = ball_at(curve, u);
    let slope = range.y * slope_at(curve, u);
    let distance = length(ball.xy);
    let half = dot_across(ball.xy, slope.xy);
    if g == 0.0 {
        let is_inside = local > 0.0 && local < 1.0;
        // The end of one part is the start of the next.
        let is_between = local == 1.0 && u < 1.0 && half >= 0.0;
        if (is_inside || is_between) && distance <= ball.w {
            add_ribbon_hit(event, vec2<f32>(ball.z), start, u, across_ribbon(ball, slope.xy));
        }
        return;
    }
    let error = g + VALUE_ERROR;
    let first = min(min(part.a.z, part.b.z), min(part.c.z, part.d.z)) - error - curve.margin;
    if abs(dot_across(part.chord, ball.xy)) > part.radius * part.chord_length {
        (*event).doubt = min((*event).doubt, max(first, start));
        return;
    }
    let speed = length(slope.xy);
    let half_error = error * speed + 6.0 * error * (distance + error);
    if local == 0.0 && half > half_error || local == 1.0 && half < -half_error {
        // Away from the part.
        return;
    }
    // How far the parameter may be off, and by what the distance, half the width and the position then are.
    let off = min((half_error + abs(half)) * reciprocal(part.convexity), 1.0);
    let closest = distance - error - off * (speed + part.across);
    let widening = off * (abs(slope.w) + 6.0 * part.radius) + error;
    if closest > ball.w + widening {
        return;
    }
    let is_inside = local - off > 0.0 && local + off < 1.0;
    let width_error = off * (abs(slope.w) + 6.0 * off * part.radius);
    if is_inside && distance + g + VALUE_ERROR < ball.w - width_error {
        let depth = error + off * (abs(slope.z) + part.bend) + curve.margin;
        add_ribbon_hit(event, vec2<f32>(ball.z - depth, ball.z + depth), start, u, across_ribbon(ball, slope.xy));
        return;
    }
    (*event).doubt = min((*event).doubt, max(first, start));
}

/// The wedge between the end of a ribbon and the start of the next one.
fn add_wedge(event: ptr<function, CurveEvent>, curve: Curve, start: f32, g: f32) {
    let end = curve.d;
    let distance = length(end.xy);
    let error = g + select(VALUE_ERROR, 0.0, g == 0.0);
    if !curve.is_joined || distance - error > end.w {
        return;
    }
    let depth = error + select(curve.margin, 0.0, g == 0.0);
    var edge = end.xy - curve.c.xy;
    if all(edge == vec2<f32>(0.0)) {
        edge = end.xy - curve.b.xy;
    }
    let size = length(edge);
    let onward = length(curve.next);
    let beyond = -dot_across(end.xy, edge);
    let before = dot_across(end.xy, curve.next);
    let edge_error = 2.0 * error * (size + distance + error);
    let next_error = 2.0 * error * (onward + distance + error);
    if beyond < -edge_error || beyond > edge_error && before < -next_error {
        return;
    }
    let is_certain = beyond > edge_error && before > next_error && distance + error < end.w && min(size, onward) > 8.0 * error;
    if is_certain || g == 0.0 && beyond > 0.0 && (before > 0.0 || onward == 0.0) {
        add_ribbon_hit(event, vec2<f32>(end.z - depth, end.z + depth), start, 1.0, across_ribbon(end, edge));
        return;
    }
    if end.z + depth >= start {
        (*event).doubt = min((*event).doubt, max(end.z - depth, start));
    }
}
