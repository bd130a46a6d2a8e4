// A ray's way through nodes, nearest first, with a stack in the invocation's own memory.
//
// The stack holds one entry a level at most: a node's word and, three bits each, its children that wait, nearest first. When
// the ray comes back to a node it tests the next of them again, by what it has hit since, so entries need no distances.
// use shared/node
// use shared/leaf
// use ?level
// use ?count
// use shared/iterations
// const STACK_SIZE
// const MAX_ITERATIONS

/// The first hit, or any; a miss where there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    var word = enter_outer(ray);
    t_max = scaled_t(ray.t_max);
    var stack: array<vec2<u32>, STACK_SIZE>;
    var n_waiting = 0u;
    // Entries of the outer level while the walk is in an instance.
    var n_outer = 0u;
    var is_inner = !HAS_INSTANCES;
    loop {
        // Nodes are entered at one place of the text, by those who come down to one and those who come back: lanes of a vector do
        // both at once, and compilers copy functions to where they are called.
        var node = word;
        var half = 0u;
        var end = 2u;
        var entry = vec2<u32>(0u);
        let is_back = word == EMPTY;
        if is_back {
            if is_inner && HAS_INSTANCES && n_waiting == n_outer {
                // The instance is done.
                is_inner = false;
                n_outer = 0u;
                enter_outer(ray);
                t_max = scaled_t(best.t);
            }
            if n_waiting == 0u {
                break;
            }
            entry = stack[n_waiting - 1u];
            node = entry.x;
            half = (entry.y & 7u) >> 2u;
            end = half + 1u;
        }
        iterations += 1u;
        if iterations > MAX_ITERATIONS {
            is_incomplete = true;
            break;
        }
        if (node & LEAF) == 0u {
            var keys = array<vec4<u32>, 2>(vec4<u32>(MISSED), vec4<u32>(MISSED));
            loop {
                keys[half] = enter(node, half, t_max);
                half += 1u;
                iterations += 1u;
                if half >= end {
                    break;
                }
            }
            if is_back {
                let child = entry.y & 7u;
                if keys[child >> 2u][child & 3u] == MISSED {
                    // What waits behind it is farther still.
                    n_waiting -= 1u;
                } else {
                    word = child_word(node, child);
                    stack[n_waiting - 1u].y = next(entry.y);
                    if (entry.y >> 24u) == 1u {
                        n_waiting -= 1u;
                    }
                }
            } else {
                count_boxes(8u);
                let children = ordered(keys[0], keys[1]);
                let n = children >> 24u;
                if n > 1u {
                    stack[n_waiting] = vec2<u32>(node, next(children));
                    n_waiting += 1u;
                }
                let nearest = child_word(node, children & 7u);
                word = select(nearest, EMPTY, n == 0u);
            }
        } else if is_inner {
            leaf(word);
            word = EMPTY;
            if any && best.primitive != NONE {
                break;
            }
        } else {
            is_inner = true;
            n_outer = n_waiting;
            word = enter_inner(ray, word);
            t_max = scaled_t(best.t);
        }
    }
    if best.primitive == NONE {
        return miss();
    }
    return placed(best);
}

/// Children without the first of them.
fn next(children: u32) -> u32 {
    return ((children & 0xffffffu) >> 3u) | ((children & 0xff000000u) - 0x1000000u);
}
