// Scenes of triangles and of curves of every kind: the parts of traversals that test curves.

// part leaf
// The curves of a leaf. A hit has `u` along the curve, and as `v` the position across a ribbon, or whether the ray leaves a tube there.
// use shared/segment/leaf
// use shared/curve

/// Events of a curve that are looked at, if the first ones are passed: an entry and an exit, or three hits of a ribbon and of its end.
const MAX_EVENTS: u32 = 4u;

/// Tests the curves of a leaf.
fn curve_leaf(word: u32) {
    var at = first_of_leaf(word);
    let n = size_of_leaf(word);
    count_triangles(n);
    iterations += n + 1u;
    for (var i = 0u; i < n; i += 1u) {
        let kind = leaf_triangles[at + 1u].w;
        if is_segment(kind) {
            iterations += SEGMENT_ITERATIONS;
            consider_segment(at, segment_of_kind(at, kind));
        } else {
            consider_curve(at, kind);
        }
        at += TRIANGLE_QUADS;
    }
}

/// Keeps the hit of a curve if it is the best.
fn consider_curve(at: u32, kind: u32) {
    let curve = curve_at(at, kind);
    if !curve.is_near {
        return;
    }
    tested_place = at;
    let number = leaf_triangles[at].w;
    let per_t = reciprocal(curve.step_t);
    let limit = clamp((t_max - curve.base_t) * per_t, -BEYOND_CURVES, BEYOND_CURVES);
    var start = clamp((space.t_min - curve.base_t) * per_t, -BEYOND_CURVES, BEYOND_CURVES);
    iterations += 1u;
    for (var i = 0u; i < MAX_EVENTS; i += 1u) {
        iterations += 1u;
        let event = event_of_curve(curve, start, limit, 0.0);
        if event.first > limit || event.first >= BEYOND_CURVES {
            return;
        }
        let t = max(curve.base_t + curve.step_t * event.first, space.t_min);
        if t > t_max {
            return;
        }
        let v = select(select(0.0, 1.0, event.is_exit), event.v, (kind & RIBBON) != 0u);
        let hit = Hit(caller_t(t), event.u, v, number, space.instance);
        if before(hit, best) && (!event.is_exit || !is_passed_at_exit(placed(hit))) && accepts(placed(hit)) {
            best = hit;
            t_max = t;
            return;
        }
        start = event.first + curve.margin + 16.0 * ROUNDING;
    }
}

// part weighed
// `t` and parameter of a hit that is certain.
// use shared/curve
// use shared/segment/weighed
// use shared/undecided/found

/// The hit of a curve in the current instance.
fn weighed_curve(index: u32, found: Found, kind: u32) -> Hit {
    let curve = curve_at(found.at, kind);
    let start = clamp((space.t_min - curve.base_t) * reciprocal(curve.step_t), -BEYOND_CURVES, BEYOND_CURVES);
    let event = event_of_curve(curve, start, BEYOND_CURVES, error_of_curve(curve, 1.0));
    if event.first >= BEYOND_CURVES {
        list(index);
    }
    let ball = ball_at(curve, event.u);
    let w = guarded_root(ball.w * ball.w - dot_across(ball.xy, ball.xy));
    let is_ribbon = (kind & RIBBON) != 0u;
    let z = ball.z + select(select(-w, w, event.is_exit), 0.0, is_ribbon);
    return Hit(caller_t(curve.base_t + curve.step_t * z), event.u, select(0.0, event.v, is_ribbon), found.primitive, found.instance);
}

/// The hit of a curve of any kind.
fn weighed_curve_or_segment(index: u32, found: Found, kind: u32) -> Hit {
    if is_segment(kind) {
        return weighed_segment(found, segment_of_kind(found.at, kind));
    }
    return weighed_curve(index, found, kind);
}

// choice weights/kinds
// Scenes of triangles and of curves of every kind.
// use shared/triangle/weighed
// use shared/curve_kinds/weighed

fn completed(index: u32, found: Found) -> Hit {
    if !is_of_curves() {
        return weighed_triangle(index, found);
    }
    return weighed_curve_or_segment(index, found, leaf_triangles[found.at + 1u].w);
}

// choice traverse/kinds
// Wide BVHs over triangles and over curves of every kind.
// use shared/traverse/loop
// use shared/triangle/leaf/records
// use shared/curve_kinds/leaf

/// Tests the primitives of a leaf.
fn leaf(word: u32) {
    if is_of_curves() {
        curve_leaf(word);
    } else {
        triangle_leaf(word);
    }
}

// choice decide/kinds
// BVHs over triangles and over curves of every kind.
// use shared/curve_kinds/certain

/// Tests the primitive at a quad, and keeps what is certain about its hit.
fn decide(at: u32) {
    if is_of_curves() {
        decide_curve_or_segment(at, leaf_triangles[at + 1u].w);
    } else {
        decide_triangle(at, false);
    }
}

// part certain
// What is certain about the hits of curves of every kind.
// use shared/segment/certain
// use shared/curve

/// Keeps what is certain about the hit of the curve at a quad.
fn decide_curve_or_segment(at: u32, kind: u32) {
    if is_segment(kind) {
        decide_segment(at, segment_of_kind(at, kind));
    } else {
        decide_curve(at, kind);
    }
}

/// Keeps what is certain about the hit of the curve at a quad.
fn decide_curve(at: u32, kind: u32) {
    let curve = curve_at(at, kind);
    let g = error_of_curve(curve, BOUND_SCALE);
    let is_usable = curve.unit > 0.0 && abs(g) < 0.5;
    if is_usable && !curve.is_near {
        return;
    }
    // All points of the curve are within 2.75 sizes of the first one, which is within 1.75 of the middle, to which the base is the nearest point of the line.
    let outer = abs(g) * curve.unit + 12.0 * ROUNDING * curve.far_off;
    let rounding = 8.0 * ROUNDING * (curve.far_off + curve.size) + TINY;
    let reach = 4.5 * curve.size + 2.0 * outer + rounding;
    if curve.base_t - reach > limit() || curve.base_t + reach < space.t_min {
        return;
    }
    if !is_usable {
        doubt = min(doubt, comparable(max(curve.base_t - reach, 0.0)));
        return;
    }
    let per_t = reciprocal(curve.step_t);
    let start = clamp((space.t_min - curve.base_t) * per_t, -BEYOND_CURVES, BEYOND_CURVES);
    let end = clamp((limit() - curve.base_t) * per_t, -BEYOND_CURVES, BEYOND_CURVES) + curve.margin;
    let event = event_of_curve(curve, start, end, g);
    if event.doubt < BEYOND_CURVES {
        doubt = min(doubt, comparable(max(curve.base_t + curve.step_t * event.doubt - rounding, 0.0)));
    }
    if event.last < BEYOND_CURVES {
        let middle = curve.base_t + curve.step_t * (0.5 * (event.first + event.last));
        keep(middle, 0.5 * (event.last - event.first) * curve.step_t + rounding, at);
    }
}
