// Ray queries. `?traverse` gives the traversal.
// use shared/ray
// use ?traverse

/// The closest hit that the mask accepts; ties go to the lowest instance, then the lowest primitive.
///
/// Primitives are numbered within their mesh, instances within the scene.
fn closest_hit(ray: Ray) -> Hit {
    return traverse(ray, false);
}

/// Whether there is any hit that the mask accepts.
fn occluded(ray: Ray) -> bool {
    return traverse(ray, true).instance != NONE;
}

// choice wide
// Wide BVHs over triangles.
// use shared/traverse/loop
// use shared/triangle/leaf/records

/// Tests the triangles of a leaf.
fn leaf(word: u32) {
    triangle_leaf(word);
}

// choice curves
// Wide BVHs over triangles and over round segments.
// use shared/traverse/loop
// use shared/triangle/leaf/records
// use shared/segment/leaf

/// Tests the primitives of a leaf.
fn leaf(word: u32) {
    if is_of_curves() {
        segment_leaf(word);
    } else {
        triangle_leaf(word);
    }
}

// part loop
// Ordered traversal with a stack in private memory. `leaf` tests the primitives of a leaf.
//
// The stack has at most one entry per level: the word of a node and, in three bits each, its pending children from the nearest.
// A pending child is tested again when the ray returns to its node, with the best hit so far. So entries need no distances.
// use shared/bvh/node
// use shared/triangle/leaf
// use ?level
// use ?count
// use shared/invocation/iterations
// const STACK_SIZE
// const MAX_ITERATIONS

/// The closest hit, or any hit; a miss if there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    is_done = false;
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    var word = enter_top(ray);
    t_max = scaled_t(ray.t_max);
    var stack: array<vec2<u32>, STACK_SIZE>;
    var n_entries = 0u;
    // Entries of the top level while the ray is in an instance.
    var n_top_level = 0u;
    var is_in_instance = !HAS_INSTANCES;
    loop {
        // One call site for descending and for returning. Lanes of a subgroup may do both at once, and compilers inline
        // functions at each call.
        var node = word;
        var half = 0u;
        var end = 2u;
        var entry = vec2<u32>(0u);
        let is_back = word == EMPTY;
        if is_back {
            if is_in_instance && HAS_INSTANCES && n_entries == n_top_level {
                // Leave the instance.
                is_in_instance = false;
                n_top_level = 0u;
                enter_top(ray);
                t_max = scaled_t(best.t);
            }
            if n_entries == 0u {
                is_done = true;
                break;
            }
            entry = stack[n_entries - 1u];
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
                    // The other pending children are farther.
                    n_entries -= 1u;
                } else {
                    word = child_word(node, child);
                    stack[n_entries - 1u].y = next(entry.y);
                    if (entry.y >> 24u) == 1u {
                        n_entries -= 1u;
                    }
                }
            } else {
                count_boxes(8u);
                let children = ordered(keys[0], keys[1]);
                let n = children >> 24u;
                if n > 1u {
                    stack[n_entries] = vec2<u32>(node, next(children));
                    n_entries += 1u;
                }
                let nearest = child_word(node, children & 7u);
                word = select(nearest, EMPTY, n == 0u);
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
            n_top_level = n_entries;
            let instance = instance_of(word);
            word = EMPTY;
            if traverses(instance) {
                word = enter_instance(ray, instance);
                t_max = scaled_t(best.t);
            }
        }
    }
    is_incomplete = is_incomplete || !is_done;
    if best.primitive == NONE {
        return miss();
    }
    return placed(best);
}

/// Removes the first child.
fn next(children: u32) -> u32 {
    return ((children & 0xffffffu) >> 3u) | ((children & 0xff000000u) - 0x1000000u);
}

// choice binary
// Binary BVHs that the device built, in the form of build/scene/pairs. Leaves hold one triangle, and one instance in the top level.
// use shared/triangle/leaf
// use shared/bvh/volume/entry
// use ?level
// use ?count
// use shared/invocation/iterations
// const STACK_SIZE
// const MAX_ITERATIONS

/// Vertices of all triangles, in the order of the meshes.
@group(0) @binding(1) var<storage, read> corners: array<f32>;

/// Tests the triangle of a leaf.
fn leaf_triangle(word: u32) {
    let triangle = word & ~LEAF;
    let a = vertex_at(9u * triangle);
    let b = vertex_at(9u * triangle + 3u);
    let c = vertex_at(9u * triangle + 6u);
    count_triangles(1u);
    tested_place = triangle;
    // `first_triangle` is the first triangle of the mesh.
    consider(a, b, c, triangle - space.first_triangle);
}

/// A vertex of the triangle at a place: its number.
fn vertex_at_place(place: u32, corner: u32) -> vec3<f32> {
    let at = 9u * place + 3u * corner;
    return vec3<f32>(corners[at], corners[at + 1u], corners[at + 2u]);
}

/// A vertex with permuted axes.
fn vertex_at(at: u32) -> vec3<f32> {
    return along_axes(vec3<f32>(corners[at], corners[at + 1u], corners[at + 2u]));
}

// Nearer children first; the others wait on a stack in private memory, at most one for each level.

/// The closest hit, or any hit; a miss if there is none.
fn traverse(ray: Ray, any: bool) -> Hit {
    is_done = false;
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    var word = enter_top(ray);
    t_max = scaled_t(ray.t_max);
    // Words of waiting children, and the bits of their entries.
    var stack: array<vec2<u32>, STACK_SIZE>;
    var n_entries = 0u;
    // Entries of the top level while the ray is in an instance.
    var n_top_level = 0u;
    var is_in_instance = !HAS_INSTANCES;
    loop {
        iterations += 1u;
        if iterations > MAX_ITERATIONS {
            is_incomplete = true;
            break;
        }
        if word == EMPTY {
            if is_in_instance && HAS_INSTANCES && n_entries == n_top_level {
                // Leave the instance.
                is_in_instance = false;
                n_top_level = 0u;
                enter_top(ray);
                t_max = scaled_t(best.t);
            }
            if n_entries == 0u {
                is_done = true;
                break;
            }
            n_entries -= 1u;
            let entry = stack[n_entries];
            word = select(EMPTY, entry.x, bitcast<f32>(entry.y) <= t_max);
        } else if (word & LEAF) == 0u {
            let left = 2u * CHILD_QUADS * word;
            let right = left + CHILD_QUADS;
            let entries = vec2<f32>(entry_of(left, t_max), entry_of(right, t_max));
            count_boxes(2u);
            let words = vec2<u32>(word_at(left), word_at(right));
            let is_right_first = entries.x < 0.0 || (entries.y >= 0.0 && entries.y < entries.x);
            let near = select(vec2<u32>(words.x, bitcast<u32>(entries.x)), vec2<u32>(words.y, bitcast<u32>(entries.y)), is_right_first);
            let far = select(vec2<u32>(words.y, bitcast<u32>(entries.y)), vec2<u32>(words.x, bitcast<u32>(entries.x)), is_right_first);
            if min(entries.x, entries.y) >= 0.0 {
                stack[n_entries] = far;
                n_entries += 1u;
            }
            word = select(EMPTY, near.x, max(entries.x, entries.y) >= 0.0);
        } else if is_in_instance {
            leaf_triangle(word);
            word = EMPTY;
            if any && best.primitive != NONE {
                is_done = true;
                break;
            }
        } else {
            is_in_instance = true;
            n_top_level = n_entries;
            let instance = instance_of(word);
            word = EMPTY;
            if traverses(instance) {
                word = enter_instance(ray, instance);
                t_max = scaled_t(best.t);
            }
        }
    }
    is_incomplete = is_incomplete || !is_done;
    if best.primitive == NONE {
        return miss();
    }
    return placed(best);
}
