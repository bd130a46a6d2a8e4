// A ray's way through nodes, nearest first, that remembers nothing but where it is.
//
// Coming back from a child, the ray tests its parent's children once more: the next is the one of the least key above that of
// the child it comes from. Entries are asked for without regard to what has been hit, so that a key is what it was.
// use shared/node
// use shared/leaf
// use ?level
// use ?count
// use shared/iterations
// use alternatives/traverse/parents
// const MAX_ITERATIONS

/// The first hit, or any; a miss where there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    var word = enter_outer(ray);
    t_max = scaled_t(ray.t_max);
    // Where `word` hangs, and where the instance does that the walk is in.
    var at = Link(EMPTY, 0u);
    var outer = at;
    var is_inner = !HAS_INSTANCES;
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
        } else if is_back || (word & LEAF) == 0u {
            // Nodes are entered at one place of the text: keys of both times are then of the same roundings.
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
