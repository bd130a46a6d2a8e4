// Traversal without a stack: measured alternatives to `shared/traverse/stack`. `benches/TRIED.md` has the timings. Both find
// the same hits and use links from each node to its parent.
// use shared/traverse
// use shared/node

/// Parent of a node, and the index of the node among its children.
struct Link {
    word: u32,
    child: u32,
}

/// One link for each line of nodes at which a node starts. The link of a root holds `EMPTY`.
@group(0) @binding(7) var<storage, read> links: array<Link>;

/// Link of a node.
fn link(word: u32) -> Link {
    return links[(space.first_node >> LINE_QUADS_LOG2) + (word & 0x1fffffffu)];
}

/// Smallest of eight keys.
fn least(a: vec4<u32>, b: vec4<u32>) -> u32 {
    let both = min(a, b);
    return min(min(both.x, both.y), min(both.z, both.w));
}

// choice bits
// Ordered traversal that stores, for each level, one bit per pending child.
//
// Source: Áfra and Szirmay-Kalos, Stackless Multi-BVH Traversal for CPU, MIC and GPU Ray Tracing, 2013. Sixteen levels fit into
// four words; the lowest eight bits belong to the current node. Pending children are tested again, with the best hit found so
// far.
// use shared/leaf/blocks
// use ?level
// use ?count
// use shared/invocation/iterations
// const MAX_ITERATIONS

/// Bits per level.
const LEVEL_BITS: u32 = 8u;

/// Pending children of the current node and of its ancestors.
var<private> levels: vec4<u32>;

fn push(children: u32) {
    levels = (levels << vec4<u32>(LEVEL_BITS)) | vec4<u32>(children, levels.xyz >> vec3<u32>(32u - LEVEL_BITS));
}

fn pop() {
    levels = (levels >> vec4<u32>(LEVEL_BITS)) | vec4<u32>(levels.yzw << vec3<u32>(32u - LEVEL_BITS), 0u);
}

/// Bit mask of the children that the ray enters.
fn entered(keys: vec4<u32>) -> u32 {
    let bits = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), keys != vec4<u32>(MISSED));
    return bits.x | bits.y | bits.z | bits.w;
}

/// The closest hit, or any hit; a miss if there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    is_done = false;
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    var word = enter_top(ray);
    t_max = scaled_t(ray.t_max);
    // Link of `word`, and link of the current instance in the top-level BVH.
    var at = Link(EMPTY, 0u);
    var outer = at;
    var is_in_instance = !HAS_INSTANCES;
    levels = vec4<u32>(0u);
    loop {
        iterations += 1u;
        if iterations > MAX_ITERATIONS {
            is_incomplete = true;
            break;
        }
        let is_back = word == EMPTY;
        if is_back && at.word == EMPTY {
            if !(HAS_INSTANCES && is_in_instance) {
                is_done = true;
                break;
            }
            // Leave the instance.
            is_in_instance = false;
            at = outer;
            enter_top(ray);
            t_max = scaled_t(best.t);
        } else if is_back && (levels.x & 0xffu) == 0u {
            pop();
            at = link(at.word);
        } else if is_back || (word & LEAF) == 0u {
            let node = select(word, at.word, is_back);
            var keys = array<vec4<u32>, 2>(vec4<u32>(MISSED), vec4<u32>(MISSED));
            for (var half = 0u; half < 2u; half += 1u) {
                keys[half] = enter(node, half, t_max);
                iterations += 1u;
            }
            count_boxes(8u);
            let among = select(vec2<u32>(15u), vec2<u32>(levels.x & 15u, (levels.x >> 4u) & 15u), is_back);
            let bits = vec4<u32>(1u, 2u, 4u, 8u);
            let a = select(vec4<u32>(MISSED), keys[0], (bits & vec4<u32>(among.x)) != vec4<u32>(0u));
            let b = select(vec4<u32>(MISSED), keys[1], (bits & vec4<u32>(among.y)) != vec4<u32>(0u));
            let next = least(a, b);
            let others = (entered(a) | (entered(b) << 4u)) & ~(1u << (next & 7u));
            if is_back {
                pop();
            }
            word = EMPTY;
            if next != MISSED {
                push(others);
                at = Link(node, next & 7u);
                word = child_word(node, at.child);
            } else if is_back {
                at = link(node);
            }
        } else if is_in_instance {
            leaf(word);
            word = EMPTY;
            if any && best.primitive != NONE {
                is_done = true;
                break;
            }
        } else {
            is_in_instance = true;
            outer = at;
            at = Link(EMPTY, 0u);
            word = enter_instance_leaf(ray, word);
            t_max = scaled_t(best.t);
        }
    }
    is_incomplete = is_incomplete || !is_done;
    if best.primitive == NONE {
        return miss();
    }
    return placed(best);
}

// choice links
// Ordered traversal without state besides the current node.
//
// After returning from a child, the ray tests all children of the parent again. The next child has the smallest key above that
// of the previous one. Keys do not depend on hits found so far, so they are the same both times.
// use shared/leaf/blocks
// use ?level
// use ?count
// use shared/invocation/iterations
// const MAX_ITERATIONS

/// The closest hit, or any hit; a miss if there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    is_done = false;
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    var word = enter_top(ray);
    t_max = scaled_t(ray.t_max);
    // Link of `word`, and link of the current instance in the top-level BVH.
    var at = Link(EMPTY, 0u);
    var outer = at;
    var is_in_instance = !HAS_INSTANCES;
    loop {
        iterations += 1u;
        if iterations > MAX_ITERATIONS {
            is_incomplete = true;
            break;
        }
        let is_back = word == EMPTY;
        if is_back && at.word == EMPTY {
            if !(HAS_INSTANCES && is_in_instance) {
                is_done = true;
                break;
            }
            // Leave the instance.
            is_in_instance = false;
            at = outer;
            enter_top(ray);
            t_max = scaled_t(best.t);
        } else if is_back || (word & LEAF) == 0u {
            // One call site for both directions, so that both compute the same keys.
            let node = select(word, at.word, is_back);
            var keys = array<vec4<u32>, 2>(vec4<u32>(MISSED), vec4<u32>(MISSED));
            for (var half = 0u; half < 2u; half += 1u) {
                keys[half] = enter(node, half, FAR);
                iterations += 1u;
            }
            count_boxes(8u);
            let after = select(vec4<u32>(0u), vec4<u32>(keys[at.child >> 2u][at.child & 3u] + 1u), is_back);
            let last = vec4<u32>(bitcast<u32>(t_max) | 7u);
            let a = select(vec4<u32>(MISSED), keys[0], (keys[0] >= after) & (keys[0] <= last));
            let b = select(vec4<u32>(MISSED), keys[1], (keys[1] >= after) & (keys[1] <= last));
            let next = least(a, b);
            if next != MISSED {
                at = Link(node, next & 7u);
                word = child_word(node, at.child);
            } else {
                word = EMPTY;
                if is_back {
                    at = link(node);
                }
            }
        } else if is_in_instance {
            leaf(word);
            word = EMPTY;
            if any && best.primitive != NONE {
                is_done = true;
                break;
            }
        } else {
            is_in_instance = true;
            outer = at;
            at = Link(EMPTY, 0u);
            word = enter_instance_leaf(ray, word);
            t_max = scaled_t(best.t);
        }
    }
    is_incomplete = is_incomplete || !is_done;
    if best.primitive == NONE {
        return miss();
    }
    return placed(best);
}
