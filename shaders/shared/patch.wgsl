// Bicubic Bézier patches, whose points may move while the shutter is open; twin of `bezier_patch` and `patch_part` in crates/trace/src
// and of `Moving` in crates/wide, in f32.
//
// # Records
// As those of other curves (shared/curve): the rows of a patch are its 16 control points, 48 numbers in twelve quads, and what moves has
// those at shutter closing after them.
//
// # Frame and units
// Control points are relative to the origin and sheared as vertices of triangles (shared/triangle), so that the line is an axis: two
// coordinates across it, in units of the largest of them, a power of two, and the scaled `t`.
//
// # Parts
// A patch is halved along the parameter with the longer steps between control points, u if they are equal, as on the CPU. Control values
// of a part are the polar form of the whole: products of three matrices, so nothing is stored but the path to the part. Halving ends
//
// * where all control points are beyond the line on one side: the part is missed;
// * at *simple* parts, see below;
// * at parts of a few roundings, at parts within a strip of a few roundings as seen along the line, and at MAX_HALVINGS and MAX_DEPTH:
//   those are undecided.
//
// Let `U` and `V` be the mean steps across the line along both parameters of a part, and (p, q) coordinates along `U` and `V`, times the
// area that they span. A part is simple if each step along u has `p >= |q| + k_u`, and each along v `q >= |p| + k_v`, with positive `k`.
// Between two points the map F of the part across the line changes by `3 (a s + b t)`, with means s and t of such steps and the
// differences a and b of the parameters. By the signs of a and b, p + q or p - q of it is as large as
//
//       |F(x) - F(y)| >= 3 (k_u |a| + k_v |b|),     |(p, q)| = |p| + |q|.     (1)
//
// So F is one-to-one, and where `|F| = r` at a point, the line meets the part within `r / (3 k)` of it in each parameter, if at all. If
// all of that is inside the part, the line passes through the part exactly once: F has as many windings at the boundary as `3 (k_u a, k_v
// b)`, into which it changes without a zero there, by (1).
//
// If p > |q| at a point y with u = 0, the line misses the part: what leads from F(y) to another point is a step along u and one forward or
// backward along v, so p + q or p - q of it is not negative, and what leads to the line has both negative. The same holds for the other
// edges, and if p + q > 0 at the corner (0, 0), where only the first is possible, and so on.
//
// Newton's steps from the middle find the point; a parameter at an end of the part beyond which F leads is held there.
//
// # Error
// Let E = 2^-23, M the largest coordinate of a control point relative to the origin, D = drift.y M + drift.x (shared/level).
//
// *Control points.* Sheared ones are within 12.5 E M + D of those of the CPU's ray (shared/triangle), 5 E M of which are roundings that
// the CPU does not have here. They cover that its hits are off the line by at most 1/4 E M (`NEAR`, `POINT` and the smallest parts of the
// twin, for an extent of 4 M), in a frame with another axis three times that. What moves errs by 6 E of its largest coordinate at any time
// (shared/curve), 12 E after shear.
//
// *Parts.* Coordinates across are below 2 in units. A matrix has rows of nonnegative weights with a sum of 1, each with four roundings;
// with the four of a product of vectors that is 8 E, twice, of 2: below SHEET_LOCAL. So control values of each part are within `g`, the
// sum of all these, of the CPU's.
//
// *Simple parts.* A step errs by 2 g + 4 E, and its p or q by that times the coordinates of `V` or `U`, and by three roundings of terms of
// up to 4 times those: together by less than 3 g times those. F at parameters is computed with an error below 36 E, at most g, so the same bounds it.
// `error` is the sum of both; `k` and `r` include it.
//
// *Along the ray* the CPU's hit errs by 5 E M: half a rounding of `t`, and four of hits at one `t`. `t` of a control point errs by 4.5 E
// M, that of a part by 16 E M and its value at parameters by 17 E M: below ALONG_ERROR, plus D.
//
// # What is certain
// The CPU counts hits by windings of parts, which sum to that of the whole, and reports them where the line meets the patch. So a part
// that is missed has none. A simple part through which the line passes once has one, if no other cancels it: parts that the CPU does not
// solve, thinner than 2^-24 of the extent, count windings only. It halves as here, so such a part is in the simple one, or contains it and
// is not thin. Only where both steps are equal but for `4 g` it may halve otherwise: then, if the line may meet other parts of the patch,
// what it meets first is in doubt, and no hit.
// use shared/bvh
// use shared/triangle
// use shared/triangle/records
// use shared/curve
// use shared/invocation/iterations
// const MAX_ITERATIONS

/// Bit of a kind, beside those of shared/curve.
const SHEET: u32 = 32u;

/// Quads of control points.
const SHEET_QUADS: u32 = 12u;

/// Halvings of a parameter, and of both, at most.
const MAX_HALVINGS: u32 = 14u;
const MAX_DEPTH: u32 = 28u;

/// Parts of a patch that a ray looks at; what is left then is undecided.
const MAX_PARTS: u32 = 256u;

/// Hits of a patch that are passed, at most: a line meets it in up to 18 points.
const SHEET_EVENTS: u32 = 18u;

/// Newton's steps at most.
const SHEET_STEPS: u32 = 10u;

/// Error of control values of a part, relative to the unit.
const SHEET_LOCAL: f32 = 36.0 * ROUNDING;

/// Error of control points that move, across and along, relative to their largest coordinate.
const SHEET_MOVING: f32 = 12.0 * ROUNDING;

/// Error of `t`, relative to M.
const ALONG_ERROR: f32 = 48.0 * ROUNDING;

/// A point that is not known better than this, in parameters of its part, is searched in its halves.
const KNOWN: f32 = 0.015625;

/// Beyond all scaled `t`.
const BEYOND_SHEETS: f32 = 3e38;

/// Control values: columns along u, in them along v.
struct Net {
    x: mat4x4<f32>,
    y: mat4x4<f32>,
    /// Scaled `t`.
    z: mat4x4<f32>,
}

/// A patch in the frame of the ray.
struct Sheet {
    net: Net,
    /// How far control values of parts across the line may be from the CPU's, in units.
    g: f32,
    /// The same of `t`.
    margin: f32,
    /// Whether the line passes all control points on one side.
    is_passed: bool,
}

/// What the ray meets first, and from where on it is in doubt, in scaled `t`.
struct SheetEvent {
    /// An interval that contains where it is; both BEYOND_SHEETS if there is nothing.
    first: f32,
    last: f32,
    t: f32,
    at: vec2<f32>,
    doubt: f32,
}

/// What is known about a part.
const IS_MISSED: u32 = 0u;
const IS_HIT: u32 = 1u;
const IS_NEAR: u32 = 2u;
const IS_OPEN: u32 = 3u;

/// A point of a part, and how far from it the line may meet the part, in its parameters.
struct Meeting {
    state: u32,
    at: vec2<f32>,
    off: vec2<f32>,
}

fn least_of(a: vec4<f32>) -> f32 {
    return min(min(a.x, a.y), min(a.z, a.w));
}

fn most_of(a: vec4<f32>) -> f32 {
    return max(max(a.x, a.y), max(a.z, a.w));
}

/// Least and greatest control value.
fn range_of(m: mat4x4<f32>) -> vec2<f32> {
    return vec2<f32>(least_of(min(min(m[0], m[1]), min(m[2], m[3]))), most_of(max(max(m[0], m[1]), max(m[2], m[3]))));
}

/// The greatest step between control values along each parameter.
fn steps_of(m: mat4x4<f32>) -> vec2<f32> {
    let of_u = max(max(abs(m[1] - m[0]), abs(m[2] - m[1])), abs(m[3] - m[2]));
    let of_v = max(max(abs(m[0].yzw - m[0].xyz), abs(m[1].yzw - m[1].xyz)), max(abs(m[2].yzw - m[2].xyz), abs(m[3].yzw - m[3].xyz)));
    return vec2<f32>(most_of(of_u), max(max(of_v.x, of_v.y), of_v.z));
}

/// The patch at a place, for the ray of the current instance. `scale` is BOUND_SCALE of shared/certain.
fn sheet_at(at: u32, kind: u32, scale: f32) -> Sheet {
    var sheet: Sheet;
    reach_in_motion = 0.0;
    let rows = rows_of_curve(at);
    var m = 0.0;
    iterations += 5u;
    for (var i = 0u; i < 4u; i += 1u) {
        let p = row_of_curve(rows, 3u * i, SHEET_QUADS, kind);
        let q = row_of_curve(rows, 3u * i + 1u, SHEET_QUADS, kind);
        let r = row_of_curve(rows, 3u * i + 2u, SHEET_QUADS, kind);
        let a = along_axes(p.xyz) - shear.origin;
        let b = along_axes(vec3<f32>(p.w, q.xy)) - shear.origin;
        let c = along_axes(vec3<f32>(q.zw, r.x)) - shear.origin;
        let d = along_axes(r.yzw) - shear.origin;
        m = max(m, max(max(greatest(a), greatest(b)), max(greatest(c), greatest(d))));
        let z = vec4<f32>(a.z, b.z, c.z, d.z);
        sheet.net.x[i] = vec4<f32>(a.x, b.x, c.x, d.x) - shear.factors.x * z;
        sheet.net.y[i] = vec4<f32>(a.y, b.y, c.y, d.y) - shear.factors.y * z;
        sheet.net.z[i] = z * reciprocal(shear.depth);
    }
    let moved = SHEET_MOVING * reach_in_motion + TINY;
    let of_points = shear_error(m) + moved;
    let x = range_of(sheet.net.x);
    let y = range_of(sheet.net.y);
    sheet.is_passed = are_beyond(x.x, x.y, scale * of_points) || are_beyond(y.x, y.y, scale * of_points);
    // Its reciprocal must not underflow, nor make the error overflow.
    let largest = max(max(max(-x.x, x.y), max(-y.x, y.y)), of_points);
    let power = clamp(bitcast<u32>(largest) & 0x7f800000u, 0x00800000u, 0x7e800000u);
    let from_unit = bitcast<f32>(0x7f000000u - power);
    sheet.net.x = from_unit * sheet.net.x;
    sheet.net.y = from_unit * sheet.net.y;
    sheet.g = scale * (of_points * from_unit + SHEET_LOCAL);
    sheet.margin = (ALONG_ERROR + space.drift.y) * m + space.drift.x + moved;
    return sheet;
}

/// Weights of control values for those of the part from `a` to `b`: a column for each.
fn weights_of_part(a: f32, b: f32) -> mat4x4<f32> {
    let p = 1.0 - a;
    let q = 1.0 - b;
    return mat4x4<f32>(
        vec4<f32>(p * p * p, 3.0 * p * p * a, 3.0 * p * a * a, a * a * a),
        vec4<f32>(p * p * q, 2.0 * a * p * q + p * p * b, a * a * q + 2.0 * a * p * b, a * a * b),
        vec4<f32>(p * q * q, a * q * q + 2.0 * p * q * b, p * b * b + 2.0 * a * q * b, a * b * b),
        vec4<f32>(q * q * q, 3.0 * q * q * b, 3.0 * q * b * b, b * b * b),
    );
}

/// The part that begins at some parameters.
fn part_of_sheet(net: Net, from_at: vec2<f32>, width: vec2<f32>) -> Net {
    let of_u = weights_of_part(from_at.x, from_at.x + width.x);
    let of_v = transpose(weights_of_part(from_at.y, from_at.y + width.y));
    return Net(of_v * net.x * of_u, of_v * net.y * of_u, of_v * net.z * of_u);
}

fn bernstein(s: f32) -> vec4<f32> {
    let r = 1.0 - s;
    return vec4<f32>(r * r * r, 3.0 * s * r * r, 3.0 * s * s * r, s * s * s);
}

/// A coordinate at parameters, and its derivatives by both.
fn jet_at(m: mat4x4<f32>, at: vec2<f32>) -> vec3<f32> {
    let r = vec2<f32>(1.0) - at;
    let of_u = m * bernstein(at.x);
    let by_u = (m[1] - m[0]) * (3.0 * r.x * r.x) + (m[2] - m[1]) * (6.0 * at.x * r.x) + (m[3] - m[2]) * (3.0 * at.x * at.x);
    let of_v = bernstein(at.y);
    let by_v = (of_u.y - of_u.x) * (3.0 * r.y * r.y) + (of_u.z - of_u.y) * (6.0 * at.y * r.y) + (of_u.w - of_u.z) * (3.0 * at.y * at.y);
    return vec3<f32>(dot_four(of_u, of_v), dot_four(by_u, of_v), by_v);
}

fn dot_four(a: vec4<f32>, b: vec4<f32>) -> f32 {
    return (a.x * b.x + a.y * b.y) + (a.z * b.z + a.w * b.w);
}

/// Where the line meets a part of which it does not pass all control points on one side.
fn meeting_of_part(part: Net, g: f32) -> Meeting {
    let open = Meeting(IS_OPEN, vec2<f32>(0.5), vec2<f32>(0.0));
    let x = part.x;
    let y = part.y;
    let one = vec4<f32>(0.25);
    let u = vec2<f32>(dot_four(x[3] - x[0], one), dot_four(y[3] - y[0], one));
    let v = vec2<f32>(
        0.25 * (((x[0].w - x[0].x) + (x[1].w - x[1].x)) + ((x[2].w - x[2].x) + (x[3].w - x[3].x))),
        0.25 * (((y[0].w - y[0].x) + (y[1].w - y[1].x)) + ((y[2].w - y[2].x) + (y[3].w - y[3].x))),
    );
    let area = cross_2d(u, v);
    let turn = select(1.0, -1.0, area < 0.0);
    let error = 3.0 * g * ((abs(u.x) + abs(u.y)) + (abs(v.x) + abs(v.y)));
    // Where the area is negative, its sign is taken.
    let along_u = turn * vec2<f32>(v.y, -v.x);
    let along_v = turn * vec2<f32>(-u.y, u.x);
    let of_u = min(
        min(apart(x[1] - x[0], y[1] - y[0], along_u, along_v), apart(x[2] - x[1], y[2] - y[1], along_u, along_v)),
        apart(x[3] - x[2], y[3] - y[2], along_u, along_v),
    );
    let first = min(
        apart(sides_of(x[0]), sides_of(y[0]), along_v, along_u),
        apart(sides_of(x[1]), sides_of(y[1]), along_v, along_u),
    );
    let second = min(
        apart(sides_of(x[2]), sides_of(y[2]), along_v, along_u),
        apart(sides_of(x[3]), sides_of(y[3]), along_v, along_u),
    );
    let k = vec2<f32>(of_u, min(first, second)) - vec2<f32>(error);
    if area == 0.0 || min(k.x, k.y) <= 0.0 {
        return open;
    }
    var at = vec2<f32>(0.5);
    var value = vec2<f32>(0.0);
    iterations += 1u;
    for (var i = 0u; i < SHEET_STEPS; i += 1u) {
        iterations += 1u;
        let jet_x = jet_at(x, at);
        let jet_y = jet_at(y, at);
        value = vec2<f32>(along_u.x * jet_x.x + along_u.y * jet_y.x, along_v.x * jet_x.x + along_v.y * jet_y.x);
        let by_u = vec2<f32>(along_u.x * jet_x.y + along_u.y * jet_y.y, along_v.x * jet_x.y + along_v.y * jet_y.y);
        let by_v = vec2<f32>(along_u.x * jet_x.z + along_u.y * jet_y.z, along_v.x * jet_x.z + along_v.y * jet_y.z);
        let is_held = vec2<bool>(is_beyond_end(at.x, value.x), is_beyond_end(at.y, value.y));
        let both = vec2<f32>(cross_2d(value, by_v), cross_2d(by_u, value)) * reciprocal(cross_2d(by_u, by_v));
        let alone = select(value * vec2<f32>(reciprocal(by_u.x), reciprocal(by_v.y)), vec2<f32>(0.0), is_held);
        let next = clamp(at - select(both, alone, any(is_held)), vec2<f32>(0.0), vec2<f32>(1.0));
        if i + 1u == SHEET_STEPS || max(abs(next.x - at.x), abs(next.y - at.y)) <= 2.0 * ROUNDING {
            break;
        }
        at = next;
    }
    let off = (abs(value.x) + abs(value.y) + error) * vec2<f32>(reciprocal(3.0 * k.x), reciprocal(3.0 * k.y));
    if all(at - off > vec2<f32>(0.0)) && all(at + off < vec2<f32>(1.0)) {
        return Meeting(IS_HIT, at, off);
    }
    // Into the part from an edge that the point is on.
    let inward = select(select(vec2<f32>(0.0), vec2<f32>(-1.0), at >= vec2<f32>(1.0)), vec2<f32>(1.0), at <= vec2<f32>(0.0));
    let beyond = inward * value;
    let is_past_edge = beyond.x - abs(value.y) > error && inward.x != 0.0 || beyond.y - abs(value.x) > error && inward.y != 0.0;
    let is_past_corner = inward.x != 0.0 && inward.y != 0.0 && beyond.x + beyond.y > error;
    if is_past_edge || is_past_corner {
        return Meeting(IS_MISSED, at, off);
    }
    return Meeting(select(IS_OPEN, IS_NEAR, max(off.x, off.y) < KNOWN), at, off);
}

fn sides_of(row: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(row.yzw - row.xyz, row.y - row.x);
}

/// By how much the parts of steps along one vector exceed those along another one, at least.
fn apart(x: vec4<f32>, y: vec4<f32>, along: vec2<f32>, across: vec2<f32>) -> f32 {
    return least_of((along.x * x + along.y * y) - abs(across.x * x + across.y * y));
}

/// Whether a parameter is at an end beyond which a value leads.
fn is_beyond_end(s: f32, value: f32) -> bool {
    return s <= 0.0 && value > 0.0 || s >= 1.0 && value < 0.0;
}

/// Whether all control points, seen along the line, are within a strip of this width.
fn is_thin(part: Net, width: f32) -> bool {
    let a = vec2<f32>(part.x[0].x, part.y[0].x);
    let b = vec2<f32>(part.x[3].x, part.y[3].x);
    let c = vec2<f32>(part.x[3].w, part.y[3].w);
    let d = vec2<f32>(part.x[0].w, part.y[0].w);
    let line = longer(longer(longer(b - a, c - b), longer(d - c, a - d)), longer(c - a, d - b));
    let square = dot_across(line, line);
    if square == 0.0 {
        let of_x = range_of(part.x);
        let of_y = range_of(part.y);
        return max(of_x.y - of_x.x, of_y.y - of_y.x) <= width;
    }
    let length = guarded_root(square);
    let across_x = line.y * reciprocal(length);
    let across_y = line.x * reciprocal(length);
    let x = part.x;
    let y = part.y;
    let height = range_of(mat4x4<f32>(
        across_y * y[0] - across_x * x[0], across_y * y[1] - across_x * x[1], across_y * y[2] - across_x * x[2], across_y * y[3] - across_x * x[3],
    ));
    return height.y - height.x <= width;
}

fn longer(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return select(a, b, dot_across(b, b) > dot_across(a, a));
}

/// The first event of the ray from `start` on, up to `limit`. `is_answer`: that of single precision, for which what is undecided is hit.
fn event_of_sheet(sheet: Sheet, start: f32, limit: f32, is_answer: bool) -> SheetEvent {
    var event = SheetEvent(BEYOND_SHEETS, BEYOND_SHEETS, 0.0, vec2<f32>(0.0), BEYOND_SHEETS);
    let g = sheet.g;
    // Bits of the path to the part, the last one first: the parameter that is halved, and which half it is.
    var halved = 0u;
    var second = 0u;
    var depth = 0u;
    var level = vec2<u32>(0u);
    var place = vec2<u32>(0u);
    var n_parts = 0u;
    // Parts that the line may meet.
    var n_met = 0u;
    // Where components of the direction are equal, the CPU's frame in an instance may have another axis.
    var is_ambiguous = max(abs(shear.factors.x), abs(shear.factors.y)) > 1.0 - 8.0 * ROUNDING - space.drift.y;
    loop {
        iterations += 1u;
        n_parts += 1u;
        if iterations > MAX_ITERATIONS || n_parts > MAX_PARTS {
            event.doubt = min(event.doubt, start);
            n_met += 2u;
            break;
        }
        // Powers of two, which a division need not give.
        let width = bitcast<vec2<f32>>((vec2<u32>(127u) - level) << vec2<u32>(23u));
        let from_at = vec2<f32>(place) * width;
        let part = part_of_sheet(sheet.net, from_at, width);
        let x = range_of(part.x);
        let y = range_of(part.y);
        let z = range_of(part.z);
        var state = IS_MISSED;
        if !are_beyond(x.x, x.y, g) && !are_beyond(y.x, y.y, g) {
            n_met += 1u;
            if z.y + sheet.margin >= start && z.x - sheet.margin <= min(limit, event.last) {
                let meeting = meeting_of_part(part, g);
                state = meeting.state;
                n_met -= u32(state == IS_MISSED || state == IS_OPEN);
                let at = from_at + width * meeting.at;
                if state == IS_HIT || state == IS_NEAR {
                    let t = clamp(jet_at(part.z, meeting.at).x, z.x, z.y);
                    if is_answer {
                        add_answer(&event, t, at, start);
                    } else if state == IS_HIT {
                        let slopes = steps_of(part.z);
                        let error = 3.0 * (meeting.off.x * slopes.x + meeting.off.y * slopes.y) + sheet.margin;
                        add_meeting(&event, t, error, at, start);
                    } else {
                        event.doubt = min(event.doubt, max(z.x - sheet.margin, start));
                    }
                }
            }
        }
        if state == IS_OPEN {
            let steps = max(steps_of(part.x), steps_of(part.y));
            let is_of_v = steps.y > steps.x;
            let is_point = max(x.y - x.x, y.y - y.x) <= 8.0 * abs(g);
            let is_strip = is_thin(part, 4.0 * abs(g));
            if is_point || is_strip || depth == MAX_DEPTH || select(level.x, level.y, is_of_v) == MAX_HALVINGS {
                n_met += 1u;
                event.doubt = min(event.doubt, max(z.x - sheet.margin, start));
                if is_answer && (is_point || !is_strip) {
                    add_answer(&event, 0.5 * (z.x + z.y), from_at + 0.5 * width, start);
                }
            } else {
                is_ambiguous = is_ambiguous || abs(steps.y - steps.x) <= 4.0 * abs(g);
                let chosen = select(vec2<u32>(1u, 0u), vec2<u32>(0u, 1u), is_of_v);
                level += chosen;
                place = place << chosen;
                halved = (halved << 1u) | chosen.y;
                second = second << 1u;
                depth += 1u;
                continue;
            }
        }
        // The second half of the last one of which that is left.
        let n_up = countTrailingZeros(~second);
        if n_up >= depth {
            break;
        }
        let n_of_v = countOneBits(halved & ((1u << n_up) - 1u));
        let up = vec2<u32>(n_up - n_of_v, n_of_v);
        level -= up;
        place = place >> up;
        depth -= n_up;
        halved = halved >> n_up;
        second = (second >> n_up) | 1u;
        place += select(vec2<u32>(1u, 0u), vec2<u32>(0u, 1u), (halved & 1u) != 0u);
    }
    if !is_answer && is_ambiguous && n_met > 1u {
        let doubt = min(event.doubt, event.first);
        return SheetEvent(BEYOND_SHEETS, BEYOND_SHEETS, 0.0, vec2<f32>(0.0), doubt);
    }
    return event;
}

/// Adds a hit of single precision.
fn add_answer(event: ptr<function, SheetEvent>, t: f32, at: vec2<f32>, start: f32) {
    if t >= start && t < (*event).last {
        (*event).first = t;
        (*event).last = t;
        (*event).t = t;
        (*event).at = at;
    }
}

/// Adds a hit that is between two positions.
fn add_meeting(event: ptr<function, SheetEvent>, t: f32, error: f32, at: vec2<f32>, start: f32) {
    let first = t - error;
    let last = t + error;
    if last < start {
        return;
    }
    if first < start {
        (*event).doubt = min((*event).doubt, start);
        return;
    }
    if first <= (*event).last && last >= (*event).first {
        (*event).doubt = min((*event).doubt, min(first, (*event).first));
    }
    if first < (*event).first {
        *event = SheetEvent(first, last, t, at, (*event).doubt);
    }
}

/// Whether a place of a BVH over curves has a patch.
fn is_sheet(kind: u32) -> bool {
    return (kind & SHEET) != 0u;
}

// part leaf
// The patches of a leaf. A hit has both parameters.
// use shared/patch

/// Tests the patches of a leaf.
fn sheet_leaf(word: u32) {
    var at = first_of_leaf(word);
    let n = size_of_leaf(word);
    count_triangles(n);
    iterations += n + 1u;
    for (var i = 0u; i < n; i += 1u) {
        consider_sheet(at, leaf_triangles[at + 1u].w);
        at += TRIANGLE_QUADS;
    }
}

/// Keeps the hit of a patch if it is the best.
fn consider_sheet(at: u32, kind: u32) {
    let sheet = sheet_at(at, kind, 1.0);
    if sheet.is_passed {
        return;
    }
    tested_place = at;
    var start = space.t_min;
    iterations += 1u;
    for (var i = 0u; i < SHEET_EVENTS; i += 1u) {
        iterations += 1u;
        let event = event_of_sheet(sheet, start, t_max, true);
        if event.t > t_max || event.first >= BEYOND_SHEETS {
            return;
        }
        let hit = Hit(caller_t(event.t), event.at.x, event.at.y, leaf_triangles[at].w, space.instance);
        if before(hit, best) && accepts(placed(hit)) {
            best = hit;
            t_max = event.t;
            return;
        }
        start = event.t + 2.0 * sheet.margin;
    }
}

// choice traverse/patches
// Wide BVHs over triangles, over curves of every kind, and over patches.
// use shared/traverse/loop
// use shared/triangle/leaf/records
// use shared/curve_kinds/leaf
// use shared/patch/leaf

/// Tests the primitives of a leaf.
fn leaf(word: u32) {
    if !is_of_curves() {
        triangle_leaf(word);
    } else if is_sheet(leaf_triangles[first_of_leaf(word) + 1u].w) {
        sheet_leaf(word);
    } else {
        curve_leaf(word);
    }
}

// choice weights/patches
// Scenes of triangles, of curves of every kind, and of patches.
// use shared/triangle/weighed
// use shared/curve_kinds/weighed
// use shared/patch

fn completed(index: u32, found: Found) -> Hit {
    if !is_of_curves() {
        return weighed_triangle(index, found);
    }
    let kind = leaf_triangles[found.at + 1u].w;
    if is_sheet(kind) {
        return weighed_sheet(index, found, kind);
    }
    return weighed_curve_or_segment(index, found, kind);
}

/// The hit of a patch in the current instance.
fn weighed_sheet(index: u32, found: Found, kind: u32) -> Hit {
    let event = event_of_sheet(sheet_at(found.at, kind, 1.0), space.t_min, BEYOND_SHEETS, false);
    // This walk visits also parts behind the hit that was decided.
    if event.first >= BEYOND_SHEETS || event.doubt <= event.last {
        list(index);
    }
    return Hit(caller_t(event.t), event.at.x, event.at.y, found.primitive, found.instance);
}

// choice decide/patches
// BVHs over triangles, over curves of every kind, and over patches.
// use shared/curve_kinds/certain
// use shared/patch

/// Tests the primitive at a quad, and keeps what is certain about its hit.
fn decide(at: u32) {
    if !is_of_curves() {
        decide_triangle(at, false);
        return;
    }
    let kind = leaf_triangles[at + 1u].w;
    if is_sheet(kind) {
        decide_sheet(at, kind);
    } else {
        decide_curve_or_segment(at, kind);
    }
}

/// Keeps what is certain about the first hit of the patch at a quad.
fn decide_sheet(at: u32, kind: u32) {
    let sheet = sheet_at(at, kind, BOUND_SCALE);
    if sheet.is_passed {
        return;
    }
    let event = event_of_sheet(sheet, space.t_min, limit(), false);
    if event.doubt < BEYOND_SHEETS {
        doubt = min(doubt, comparable(max(event.doubt, 0.0)));
    }
    if event.first < BEYOND_SHEETS {
        keep(event.t, max(event.t - event.first, event.last - event.t), at);
    }
}
