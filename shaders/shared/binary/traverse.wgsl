// Binary BVHs that the device built, in the form of build/pairs. Leaves hold one triangle, and one instance in the top level.
// use shared/traverse
// use shared/leaf
// use shared/binary/volume/entry
// use ?level
// use ?count
// use shared/invocation/iterations
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
    // `first_half` is the first triangle of the mesh.
    consider(a, b, c, triangle - space.first_half);
}

/// A vertex with permuted axes.
fn vertex_at(at: u32) -> vec3<f32> {
    return along_axes(vec3<f32>(corners[at], corners[at + 1u], corners[at + 2u]));
}

// choice stack
// Nearer children first; the others wait on a stack in private memory, at most one for each level.
// const STACK_SIZE

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
