// The best hit of a traversal.
// use shared/triangle
// use shared/exact/triangle
// use ?level
// use ?mask
// use ?count
// use shared/invocation/iterations

/// Whether traversal stopped after `MAX_ITERATIONS`. The result may then not be the closest hit, or may miss.
var<private> is_incomplete: bool;

/// Whether traversal came to its end. If not, the driver ended a loop early.
var<private> is_done: bool;

/// Best hit so far. `t` is in the caller's units, the primitive is numbered by its BVH.
var<private> best: Hit;

/// Scaled `t` of the best hit.
var<private> t_max: f32;

/// Tests triangle `number` of the BVH, by its vertices with permuted axes, and keeps its hit if it is the best.
fn consider(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, number: u32) {
    // The CPU misses triangles with two equal vertices. Relative to the origin of an instance's ray, others may be equal, too.
    if all(a == b) || all(b == c) || all(c == a) {
        return;
    }
    let found = intersect_triangle(a - shear.origin, b - shear.origin, c - shear.origin);
    // `t` in the caller's units decides, as everywhere.
    if found.t >= space.t_min && found.t <= t_max {
        let hit = Hit(caller_t(found.t), found.weights.y, found.weights.z, number, space.instance);
        if before(hit, best) && (!found.is_near || is_hit_exactly(a, b, c)) && accepts(placed(hit)) {
            best = hit;
            t_max = found.t;
        }
    }
}

/// Whether the CPU hits a triangle with an edge near the ray, or may hit it, in an instance that moves.
fn is_hit_exactly(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    if !is_exact {
        prepare_exact_shear(exact_ray());
        is_exact = true;
    }
    return !exact_shear.is_known || is_hit_on_cpu(a, b, c);
}

// part blocks
// Triangle tests of the leaves of wide BVHs.
// use shared/triangle/blocks

/// Bits of a leaf word for its first triangle, in units of half a half-block.
const LEAF_FIRST: u32 = 0x03ffffffu;

/// Tests the triangles of a leaf: blocks of eight, then one block of four. A leaf of two may use the second half of a block of
/// four.
fn leaf(word: u32) {
    let first = word & LEAF_FIRST;
    var n = ((word >> 26u) & 31u) + 1u;
    var at = space.first_half + (first >> 1u) * HALF_QUADS;
    var is_second = false;
    count_triangles(n);
    loop {
        let stride = select(1u, 2u, is_second || n > 4u);
        let first_quad = at + select(0u, 1u, is_second);
        let filled = ((1u << min(n, 4u)) - 1u) << ((first & 1u) * 2u);
        four_triangles(first_quad, stride, filled);
        if n <= 4u {
            break;
        }
        n -= 4u;
        at += select(0u, 2u * HALF_QUADS, is_second);
        is_second = !is_second;
    }
}

/// Tests those of four triangles that are set in `filled`.
fn four_triangles(at: u32, stride: u32, filled: u32) {
    var pending = candidates(at, stride) & filled;
    // One for the block, and one in which the loop ends.
    iterations += 2u + countOneBits(pending);
    loop {
        if pending == 0u {
            break;
        }
        let lane = firstTrailingBit(pending);
        pending &= pending - 1u;
        let number = triangle_blocks[at + 9u * stride][lane];
        consider(vertex(at, stride, 0u, lane), vertex(at, stride, 1u, lane), vertex(at, stride, 2u, lane), number);
    }
}
