// Traversal of wide BVHs, in one level or two, that decides by f32 alone, and says which rays it cannot decide.
//
// An answer is final where no rounding can change it: then it is the CPU's hit. The other rays are undecided, and the exact kernels
// (`trace/closest`, `trace/occluded`, of listed rays) trace them again. So this loop needs neither exact edge tests nor emulated arithmetic.
//
// # Order
// The host and build/wide/children store the children of a node by octants: child `i` lies toward the corner of the node whose coordinates
// are high where bits 0, 1, 2 of `i` are set. A ray takes the children in the order of `i ^ octant`, where `octant` has a bit for each
// negative component of its direction (Ylitie, Karras and Laine 2017). Any order is correct. The pending children of a node are one mask, and
// the stack has one entry, node and mask, for each level. So each node is read and tested once, nothing is sorted, and no distance is kept.
// The leaves among the children that a ray enters are tested at once, triangle by triangle in one loop, so that neighboring rays test triangles
// together whichever leaves they are in. A leaf of the top level is an instance. Its nodes are pending above those of the top level, which the
// ray enters again when they are done.
//
// # What is certain
// Let E, M, g and the sheared coordinates be as in shared/triangle. An edge function of the CPU's triangle differs from the computed one
// by at most `(g + 5 E M) (N + 2 g)` as derived there, where N may be the sum of the coordinates of the two vertices of its edge.
// M is that of the triangle. If all three are beyond their bounds on the same side, the CPU hits; if two are beyond them on
// different sides, it misses; otherwise the triangle is in doubt.
//
// *Point.* Weights in proportion to the edge functions describe a point of the plane of the computed triangle, `off` from the ray, which is
// computed with an error of 6 E M; two roundings more and the sum of the weights are within 8 E M. It only bounds `t`: `trace/certain_weights`
// reports the hit with the weights of the exact kernel (shared/triangle, *Inside*), whose point is within 27 E M of the crossing.
//
// *Distance.* The CPU reports a point within 10 E M in each coordinate of its triangle (`canted_trace::HIT_ERROR`), so within 20 E M across after
// shear, and within 27.5 E M of a point of the plane of the computed triangle. So the two points of that plane differ by at most `off + 35.5 E M`
// across, and their depths by that times the slope of the plane, the sum of its absolute components. The slope is the quotient of components of
// the normal: the dividends err by 4 E of their terms, of which 8 are added, and the divisor, the sum of the edge functions, by less than a quarter,
// because each is beyond its bound, of which its own roundings are less than a quarter; 1.4 covers that. Along the ray the
// CPU's point errs by 10 E M and 1 E M, and the weighted sum of the `t_i = z_i / depth` by 13 E M: 24 E M.
//
// *Instances.* The ray in an instance differs from the CPU's: by half of `space.drift.x` in each coordinate of the origin, and by half of
// `space.drift.y` in the direction, whose largest component is at least 1 (shared/level). A hit lies within M, so at its `t` the rays are
// `D / 2` apart, with `D = drift.y M + drift.x`. `g` includes D. The CPU's point is off by as much more: by D across, after shear, and by less along the ray.
// Intervals of `t` are compared in units of the caller's direction, which are those of each instance times a power of two. A bound that
// leaves the range of f32 there is clamped, which keeps the order of bounds or makes them equal, and then the ray is in doubt.
//
// *Closest hit.* A hit is certain to be the first if the interval of its `t` ends before all others begin. Where it overlaps that of another triangle, or an
// end of the ray, the ray is in doubt from there on. At the end a ray is undecided unless its hit ends before the first doubt.
//
// *Boxes* are thickened as for the exact kernel (shared/bvh), and the upper end of the best interval bounds them, so no hit is lost.
// use shared/bvh/node
// use shared/triangle/records
// use ?level
// use ?count
// use ?decide
// use shared/invocation/iterations
// const STACK_SIZE
// const MAX_ITERATIONS

/// Scale of the bounds of edges. Tests set it to -1, and must then find wrong hits.
override BOUND_SCALE: f32 = 1.0;

/// Roundings of `t`, relative to M.
const DISTANCE_ROUNDING: f32 = 24.0 * ROUNDING;

/// Largest distance across the ray of the CPU's point from that of the weights, but for `off`, relative to M.
const ACROSS_ROUNDING: f32 = 36.0 * ROUNDING;

/// Roundings of the dividend of a slope, relative to its terms.
const SLOPE_ROUNDING: f32 = 8.0 * ROUNDING;

/// Bound of the divisor of a slope.
const SLOPE_FACTOR: f32 = 1.4;

/// Entries of the stack. Mesa's RADV keeps arrays of up to 256 bytes in registers, which other numbers need, and searches them.
const ENTRIES: u32 = max(STACK_SIZE, 33u);

/// Beyond all `t`.
const NEVER: f32 = 3.4028235e38;

/// Interval of the `t` of the best hit, in `comparable` units; the end of the ray before there is one.
var<private> best_first: f32;
var<private> best_last: f32;

/// `best_last` in the units of the current instance.
var<private> limit_in_instance: f32;

/// The best hit: number of its triangle, `NONE` for no hit, its instance, and the first quad of the triangle.
var<private> best_number: u32;
var<private> best_instance: u32;
var<private> best_at: u32;

/// Least `t` of what is in doubt.
var<private> doubt: f32;

/// A ray of the kernel's `rays`, read again on the way out of an instance. Otherwise it waits in registers meanwhile: with aligned nodes RADV
/// gfx1100 then takes 120 vector registers instead of 84. Compilers join two reads of the same place, so they must not see that the sum is `index`:
/// iterations have less than 32 bits.
fn ray_again(index: u32) -> Ray {
    return rays[index + (iterations >> 31u)];
}

/// The ray that entered the top level, without its end. Its direction is the one given, but for components whose scaled ones are subnormal.
fn ray_of_top_level(t_min: f32) -> Ray {
    return Ray(space.origin, t_min, space.direction * space.to_scaled, FAR);
}

/// Finds the closest hit, or any hit, of a ray of the kernel's `rays`: `best_number`, `best_instance` and `best_at`. Returns whether the
/// answer is certain.
fn is_certain_hit(index: u32, any: bool) -> bool {
    let ray = rays[index];
    var word = enter_top(ray);
    limit_in_instance = scaled_t(ray.t_max);
    best_last = comparable(limit_in_instance);
    best_first = best_last;
    best_number = NONE;
    best_instance = NONE;
    doubt = NEVER;
    var is_done = word == EMPTY;
    var octant = octant_of_space();
    var stack: array<vec2<u32>, ENTRIES>;
    var n_entries = 0u;
    // Entries of the top level while the ray is in an instance.
    var n_top_level = 0u;
    var is_in_instance = !HAS_INSTANCES;
    // A node, and a mask of its pending children in the order of the ray.
    var pending = vec2<u32>(0u);
    loop {
        iterations += 1u;
        if is_done || iterations > MAX_ITERATIONS {
            break;
        }
        if HAS_INSTANCES && !is_in_instance && (word & LEAF) != 0u {
            if pending.y != 0u {
                stack[n_entries] = pending;
                n_entries += 1u;
            }
            pending.y = 0u;
            is_in_instance = true;
            n_top_level = n_entries;
            word = enter_instance_leaf(ray_of_top_level(ray.t_min), word);
            limit_in_instance = scaled_t(best_last);
            octant = octant_of_space();
        }
        var leaf_word = word;
        var leaves = 0u;
        if (word & LEAF) == 0u && word != EMPTY {
            if pending.y != 0u {
                stack[n_entries] = pending;
                n_entries += 1u;
            }
            leaf_word = EMPTY;
            let masks = entered(word, octant, is_in_instance);
            pending = vec2<u32>(word, masks.x);
            leaves = masks.y;
            count_boxes(8u);
        }
        is_done = is_settled(leaf_word, word, leaves, octant, any);
        if is_done {
            break;
        }
        if pending.y == 0u {
            if HAS_INSTANCES && is_in_instance && n_entries == n_top_level {
                is_in_instance = false;
                n_top_level = 0u;
                enter_top(ray_again(index));
                limit_in_instance = scaled_t(best_last);
                octant = octant_of_space();
            }
            if n_entries == 0u {
                is_done = true;
                break;
            }
            n_entries -= 1u;
            pending = stack[n_entries];
        }
        let rank = firstTrailingBit(pending.y);
        pending.y &= pending.y - 1u;
        word = child_word(pending.x, rank ^ octant);
    }
    return is_done && doubt > best_last || any && best_number != NONE;
}

/// Tests the triangles of `first_leaf`, if it is a leaf, then those of the children of a node in the mask `leaves`. Returns whether any hit is enough
/// and there is one.
fn is_settled(first_leaf: u32, node: u32, mask: u32, octant: u32, any: bool) -> bool {
    var leaf = first_leaf;
    var leaves = mask;
    var at = 0u;
    var end = 0u;
    loop {
        if at == end {
            if (leaf & LEAF) == 0u {
                if leaves == 0u {
                    return false;
                }
                leaf = child_word(node, firstTrailingBit(leaves) ^ octant);
                leaves &= leaves - 1u;
            }
            let n = size_of_leaf(leaf);
            at = first_of_leaf(leaf);
            end = at + TRIANGLE_QUADS * n;
            leaf = EMPTY;
            iterations += n;
            count_triangles(n);
        }
        decide(at);
        at += TRIANGLE_QUADS;
        if any && best_number != NONE {
            return true;
        }
    }
    return false;
}

/// A scaled `t` in units in which those of all instances are compared: the caller's, or the scaled ones in one level.
fn comparable(t: f32) -> f32 {
    if HAS_INSTANCES {
        return caller_t(t);
    }
    return t;
}

/// `best_last` in the units of the current space.
fn limit() -> f32 {
    if HAS_INSTANCES {
        return limit_in_instance;
    }
    return best_last;
}

/// A bit for each component of the direction that is negative in the frame of the BVH.
fn octant_of_space() -> u32 {
    let backward = select(vec3<u32>(0u), vec3<u32>(1u, 2u, 4u), space.recip < vec3<f32>(0.0));
    return (backward.x | backward.y) | backward.z;
}

/// Masks of the children of a node that the ray enters, in its order: those to traverse, and leaves.
fn entered(word: u32, octant: u32, are_leaves_apart: bool) -> vec2<u32> {
    // For the loop over halves of an oriented node, with the one in which it ends.
    iterations += 3u;
    let all = entered_of(word, limit());
    let leaves = select(0u, all & leaves_of(word), are_leaves_apart);
    let both = in_order((all ^ leaves) | (leaves << 8u), octant);
    return vec2<u32>(both & 0xffu, both >> 8u);
}

/// Two masks of children, from bit 0 and from bit 8 on, in the order of the ray: bit `i` is that of child `i ^ octant`.
fn in_order(masks: u32, octant: u32) -> u32 {
    var both = masks;
    both = select(both, ((both & 0x5555u) << 1u) | ((both >> 1u) & 0x5555u), (octant & 1u) != 0u);
    both = select(both, ((both & 0x3333u) << 2u) | ((both >> 2u) & 0x3333u), (octant & 2u) != 0u);
    return select(both, ((both & 0x0f0fu) << 4u) | ((both >> 4u) & 0x0f0fu), (octant & 4u) != 0u);
}

/// A vertex relative to the origin, with permuted axes; the permuted origin would take three registers beside this one.
fn from_origin(at: u32) -> vec3<f32> {
    return along_axes(bitcast<vec3<f32>>(leaf_triangles[at].xyz) - space.origin);
}

/// Tests the triangle at a quad, and keeps what is certain about its hit: nothing where `is_masked`.
fn decide_triangle(at: u32, is_masked: bool) {
    let a = from_origin(at);
    let b = from_origin(at + 1u);
    let c = from_origin(at + 2u);
    let m = max(greatest(a), max(greatest(b), greatest(c)));
    // Edge functions, and their bounds.
    let p = a.xy - shear.factors * a.z;
    let q = b.xy - shear.factors * b.z;
    let r = c.xy - shear.factors * c.z;
    let edges = vec3<f32>(r.x * q.y - r.y * q.x, p.x * r.y - p.y * r.x, q.x * p.y - q.y * p.x);
    let sizes = vec3<f32>(abs(p.x) + abs(p.y), abs(q.x) + abs(q.y), abs(r.x) + abs(r.y));
    let drift = space.drift.y * m + space.drift.x;
    let apart = SHEAR_ROUNDING * m + drift;
    let bounds = (BOUND_SCALE * (apart + FILTER_ROUNDING * m)) * ((sizes.yzx + sizes.zxy) + vec3<f32>(2.0 * apart)) + vec3<f32>(TINY);
    let low = edges - bounds;
    let high = edges + bounds;
    if max(low.x, max(low.y, low.z)) > 0.0 && min(high.x, min(high.y, high.z)) < 0.0 {
        return;
    }
    let ts = vec3<f32>(a.z, b.z, c.z) * reciprocal(shear.depth);
    let rounding = DISTANCE_ROUNDING * m + drift + TINY;
    let first = min(ts.x, min(ts.y, ts.z)) - rounding;
    let last = max(ts.x, max(ts.y, ts.z)) + rounding;
    if first > limit() || last < space.t_min {
        return;
    }
    let inverse = guarded_quotient(1.0, (edges.x + edges.y) + edges.z);
    let weights = edges * inverse;
    let off = max(abs(weights.x * p.x + (weights.y * q.x + weights.z * r.x)), abs(weights.x * p.y + (weights.y * q.y + weights.z * r.y)));
    let is_in = min(low.x, min(low.y, low.z)) > 0.0 || max(high.x, max(high.y, high.z)) < 0.0;
    if is_masked || !is_in {
        doubt = min(doubt, comparable(first));
        return;
    }
    let t = weights.x * ts.x + (weights.y * ts.y + weights.z * ts.z);
    // The slope of the plane, by two edges.
    let f = vec3<f32>(q - p, b.z - a.z);
    let g = vec3<f32>(r - p, c.z - a.z);
    let terms = f.yzzx * g.zyxz;
    let slope = (abs(terms.x - terms.y) + abs(terms.z - terms.w)) + SLOPE_ROUNDING * ((abs(terms.x) + abs(terms.y)) + (abs(terms.z) + abs(terms.w)));
    let error = rounding + (SLOPE_FACTOR * slope) * abs(inverse) * (off + (ACROSS_ROUNDING * m + drift));
    keep(t, error, at);
}

/// Keeps a hit whose scaled `t` is known within an error.
fn keep(t: f32, error: f32, at: u32) {
    let is_before_start = t - error < space.t_min;
    let is_behind = t + error < space.t_min;
    let first = comparable(t - error);
    let last = comparable(t + error);
    let number = leaf_triangles[at].w;
    // A triangle may be in two leaves.
    if first > best_last || is_behind || number == best_number && space.instance == best_instance {
        return;
    }
    if is_before_start {
        doubt = min(doubt, first);
        return;
    }
    if last >= best_first {
        doubt = min(doubt, min(first, best_first));
        if best_number == NONE {
            // At the end of the ray.
            return;
        }
    }
    best_first = min(best_first, first);
    if last <= best_last {
        best_last = last;
        limit_in_instance = t + error;
    }
    best_number = number;
    best_instance = space.instance;
    best_at = at;
}

// choice decide/triangles
// BVHs over triangles.

/// Tests the triangle at a quad, and keeps what is certain about its hit.
fn decide(at: u32) {
    decide_triangle(at, false);
}

// choice decide/masked
// BVHs over triangles, of which some are marked: whether a hit of those counts is decided by exact kernels with more than the geometry, such as textures.

/// Tests the triangle at a quad, and keeps what is certain about its hit.
fn decide(at: u32) {
    decide_triangle(at, leaf_triangles[at + 1u].w != 0u);
}

// choice decide/curves
// BVHs over triangles and over round segments.
// use shared/segment/certain

/// Tests the primitive at a quad, and keeps what is certain about its hit.
fn decide(at: u32) {
    if is_of_curves() {
        decide_segment(at, segment_at(at));
    } else {
        decide_triangle(at, false);
    }
}
