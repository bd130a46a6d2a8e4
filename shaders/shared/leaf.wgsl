// The triangles of leaves, and what a walk has found in them.
// use shared/triangle
// use ?level
// use ?mask
// use ?count
// use shared/iterations

/// Places of a leaf's first triangle: two a half-block.
const LEAF_FIRST: u32 = 0x03ffffffu;

/// Whether a walk of this invocation ended early, after `MAX_ITERATIONS` turns: its answer may not be the first hit, or none.
var<private> is_incomplete: bool;

/// What the walk has found, `t` the caller's, the primitive as the tree numbers it.
var<private> best: Hit;

/// Where the walk stands: scaled `t` of the best hit, stack entries, and those of them that belong to the outer level.
var<private> t_max: f32;

/// Tests the triangles of a leaf: blocks of eight, then one of four; a leaf of two may be the second half of one of four.
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

/// Tests those of four triangles that `filled` names.
fn four_triangles(at: u32, stride: u32, filled: u32) {
    var waiting = candidates(at, stride) & filled;
    iterations += 1u + countOneBits(waiting);
    loop {
        if waiting == 0u {
            break;
        }
        let lane = firstTrailingBit(waiting);
        waiting &= waiting - 1u;
        let found = intersect_triangle(at, stride, lane);
        // The comparison of `t` in the caller's units decides, as everywhere.
        if found.t >= space.t_min && found.t <= t_max {
            let number = triangle_blocks[at + 9u * stride][lane];
            let hit = Hit(caller_t(found.t), found.weights.y, found.weights.z, number, space.instance);
            if before(hit, best) && accepts(placed(hit)) {
                best = hit;
                t_max = found.t;
            }
        }
    }
}
