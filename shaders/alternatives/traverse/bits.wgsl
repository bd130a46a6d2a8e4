// A ray's way through nodes, nearest first, with eight bits a level: the children that wait.
//
// After Áfra and Szirmay-Kalos, Stackless Multi-BVH Traversal for CPU, MIC and GPU Ray Tracing, 2013. Sixteen levels fit into a
// vector of four words, the lowest bits those of the node that the ray is at; links lead up. Children that wait are tested
// again, by what has been hit since.
// use shared/node
// use shared/leaf
// use ?level
// use ?count
// use shared/iterations
// use alternatives/traverse/parents
// const MAX_ITERATIONS

/// Bits of a level.
const LEVEL_BITS: u32 = 8u;

/// Children that wait, of the node that the walk is at and of all above.
var<private> levels: vec4<u32>;

fn push(children: u32) {
    levels = (levels << vec4<u32>(LEVEL_BITS)) | vec4<u32>(children, levels.xyz >> vec3<u32>(32u - LEVEL_BITS));
}

fn pop() {
    levels = (levels >> vec4<u32>(LEVEL_BITS)) | vec4<u32>(levels.yzw << vec3<u32>(32u - LEVEL_BITS), 0u);
}

/// Bits of four children that are entered.
fn entered(keys: vec4<u32>) -> u32 {
    let bits = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), keys != vec4<u32>(MISSED));
    return bits.x | bits.y | bits.z | bits.w;
}

/// The first hit, or any; a miss where there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    var word = enter_outer(ray);
    t_max = scaled_t(ray.t_max);
    // Where `word` hangs, and where the instance does that the walk is in.
    var at = Link(EMPTY, 0u);
    var outer = at;
    var is_inner = !HAS_INSTANCES;
    levels = vec4<u32>(0u);
    loop {
        iterations += 1u;
        if iterations > MAX_ITERATIONS {
            is_incomplete = true;
            break;
        }
        let is_back = word == EMPTY;
        if is_back && at.word == EMPTY {
            if !(HAS_INSTANCES && is_inner) {
                break;
            }
            // The instance is done.
            is_inner = false;
            at = outer;
            enter_outer(ray);
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
        } else if is_inner {
            leaf(word);
            word = EMPTY;
            if any && best.primitive != NONE {
                break;
            }
        } else {
            is_inner = true;
            outer = at;
            at = Link(EMPTY, 0u);
            word = enter_inner(ray, word);
            t_max = scaled_t(best.t);
        }
    }
    if best.primitive == NONE {
        return miss();
    }
    return placed(best);
}
