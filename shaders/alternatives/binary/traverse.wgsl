// Traversal of binary BVHs without a stack: alternatives to `shared/binary/traverse/stack`. All find the same hits. A ray returns by
// links from each node to its parent, and tests the other child again, with the best hit so far.
// use shared/binary/traverse

/// For each node: its parent's number times two, plus 1 for a right child, plus 1; 0 for a root.
@group(0) @binding(7) var<storage, read> pair_links: array<u32>;

/// A child by its link: the parent and the side.
fn child_quad(link: u32) -> u32 {
    return CHILD_QUADS * (link - 1u);
}

/// The closest hit, or any hit; a miss if there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    is_done = false;
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    forget();
    var word = enter_top(ray);
    t_max = scaled_t(ray.t_max);
    // The child that the ray is in or returns from; 0 for a root.
    var link = 0u;
    // That child of the top level while the ray is in an instance.
    var top_link = 0u;
    var is_in_instance = !HAS_INSTANCES;
    loop {
        iterations += 1u;
        if iterations > MAX_ITERATIONS {
            is_incomplete = true;
            break;
        }
        if word == EMPTY {
            if link == 0u {
                if !is_in_instance || !HAS_INSTANCES {
                    is_done = true;
                    break;
                }
                // Leave the instance.
                is_in_instance = false;
                link = top_link;
                enter_top(ray);
                t_max = scaled_t(best.t);
                if link == 0u {
                    is_done = true;
                    break;
                }
            }
            let other = ((link - 1u) ^ 1u) + 1u;
            if other_waits(link) && entry_of(child_quad(other), t_max) >= 0.0 {
                link = other;
                word = word_at(child_quad(other));
            } else {
                rise();
                link = pair_links[(link - 1u) >> 1u];
            }
        } else if (word & LEAF) == 0u {
            let left = 2u * CHILD_QUADS * word;
            let entries = vec2<f32>(entry_of(left, t_max), entry_of(left + CHILD_QUADS, t_max));
            count_boxes(2u);
            if max(entries.x, entries.y) < 0.0 {
                word = EMPTY;
                // Return from this node.
                continue;
            }
            let are_both = min(entries.x, entries.y) >= 0.0;
            let is_right = select(entries.x < 0.0, is_right_nearer(left), are_both);
            descend(are_both);
            link = 2u * word + select(0u, 1u, is_right) + 1u;
            word = word_at(child_quad(link));
        } else if is_in_instance {
            leaf_triangle(word);
            word = EMPTY;
            if any && best.primitive != NONE {
                is_done = true;
                break;
            }
        } else {
            is_in_instance = true;
            top_link = link;
            link = 0u;
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

/// Whether the right one of two children is entered first, whatever the best hit. `left` is the quad of the left one.
fn is_right_nearer(left: u32) -> bool {
    return start_of(left + CHILD_QUADS) < start_of(left);
}

// choice bits
// A bit for each level: whether the other child still waits.
//
// Source: Áfra and Szirmay-Kalos, Stackless Multi-BVH Traversal for CPU, MIC and GPU Ray Tracing, 2013, with four words, for 128
// levels.

var<private> waiting: vec4<u32>;

fn forget() {
    waiting = vec4<u32>(0u);
}

fn descend(other_is_entered: bool) {
    waiting = (waiting << vec4<u32>(1u)) | vec4<u32>(select(0u, 1u, other_is_entered), waiting.xyz >> vec3<u32>(31u));
}

fn rise() {
    waiting = (waiting >> vec4<u32>(1u)) | vec4<u32>(waiting.yzw << vec3<u32>(31u), 0u);
}

/// Whether the child beside this one waits; then it does no more.
fn other_waits(link: u32) -> bool {
    let waits = (waiting.x & 1u) != 0u;
    waiting.x &= ~1u;
    return waits;
}

// choice links
// No memory: a ray that returns from the nearer child goes on to the farther one, and from the farther one to the parent.
//
// Source: Hapala et al., Efficient Stack-less BVH Traversal for Ray Tracing, 2011: three states, here without the third, because
// the volume of a child is tested before the ray goes there.

fn forget() {}

fn descend(other_is_entered: bool) {}

fn rise() {}

/// Whether the child beside this one waits: this one is the nearer.
fn other_waits(link: u32) -> bool {
    let is_right = ((link - 1u) & 1u) != 0u;
    return is_right == is_right_nearer(CHILD_QUADS * ((link - 1u) & ~1u));
}
