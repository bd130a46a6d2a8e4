// choice aligned
// BVHs with aligned nodes only.
// use shared/node

/// Keys of four children of a node.
fn enter(word: u32, half: u32, t_max: f32) -> vec4<u32> {
    return enter_aligned(quads_of(word) + half, half, t_max);
}

/// The word of a child.
fn child_word(word: u32, child: u32) -> u32 {
    return nodes[quads_of(word) + 12u + (child >> 2u)][child & 3u];
}

// choice any
// Aligned nodes, and oriented nodes with a frame per child.
// use shared/node
// use shared/invocation/iterations

/// Keys of four children of a node.
fn enter(word: u32, half: u32, t_max: f32) -> vec4<u32> {
    let at = quads_of(word) + half;
    switch word >> 29u {
        case 0u: {
            return enter_aligned(at, half, t_max);
        }
        default: {
            return enter_oriented(at, half, t_max);
        }
    }
}

/// The word of a child.
fn child_word(word: u32, child: u32) -> u32 {
    let row = select(30u, 12u, (word >> 29u) == 0u);
    return nodes[quads_of(word) + row + (child >> 2u)][child & 3u];
}

/// For each axis: three components of the children's rows, centers, half-extents.
fn enter_oriented(at: u32, half: u32, t_max: f32) -> vec4<u32> {
    var near = vec4<f32>(space.t_min);
    var far = vec4<f32>(t_max);
    iterations += 4u;
    for (var k = 0u; k < 3u; k += 1u) {
        let q = at + 10u * k;
        let x = quad(q);
        let y = quad(q + 2u);
        let z = quad(q + 4u);
        let p = x * space.origin.x + (y * space.origin.y + (z * space.origin.z - quad(q + 6u)));
        let d = x * space.direction.x + (y * space.direction.y + z * space.direction.z);
        let h = quad(q + 8u) + vec4<f32>(space.oriented_pad);
        let a = guarded_reciprocals(d);
        let center = select(p, -p, d < vec4<f32>(0.0)) * a;
        near = max(-(h * a) - center, near);
        far = min(h * a - center, far);
    }
    return keys(near, far, half);
}

/// `1/|d|`, bounded.
fn guarded_reciprocals(d: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(1.0) / max(abs(d), vec4<f32>(MIN_DIRECTION));
}
