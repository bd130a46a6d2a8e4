// Nodes along the axes, in a frame of their own, and with a frame for each child.
// use shared/node

/// Keys of four children of a node.
fn enter(word: u32, half: u32, t_max: f32) -> vec4<u32> {
    let at = quads_of(word) + half;
    switch word >> 29u {
        case 0u: {
            return enter_box(at, half, t_max);
        }
        case 1u: {
            return enter_shared(at, half, t_max);
        }
        default: {
            return enter_lean(at, half, t_max);
        }
    }
}

/// The word of a child.
fn child_word(word: u32, child: u32) -> u32 {
    var row = 30u;
    switch word >> 29u {
        case 0u: {
            row = 12u;
        }
        case 1u: {
            row = 16u;
        }
        default: {}
    }
    return nodes[quads_of(word) + row + (child >> 2u)][child & 3u];
}

/// Nine numbers of one frame, padding to two rows, then as a box node in that frame.
fn enter_shared(at: u32, half: u32, t_max: f32) -> vec4<u32> {
    let first = quad(at - half);
    let second = quad(at - half + 1u);
    let third = quad(at - half + 2u);
    var near = vec4<f32>(space.t_min);
    var far = vec4<f32>(t_max);
    for (var k = 0u; k < 3u; k += 1u) {
        var row = first.xyz;
        if k == 1u {
            row = vec3<f32>(first.w, second.x, second.y);
        } else if k == 2u {
            row = vec3<f32>(second.z, second.w, third.x);
        }
        let origin = project(row, space.origin);
        let recip = reciprocal(project(row, space.direction));
        let lo = (quad(at + 4u + 4u * k) - vec4<f32>(origin + space.pad_lean)) * recip;
        let hi = (quad(at + 6u + 4u * k) - vec4<f32>(origin - space.pad_lean)) * recip;
        near = max(min(lo, hi), near);
        far = min(max(lo, hi), far);
    }
    return keys(near, far, half);
}

/// For each axis three components of the children's rows, centres, half-extents.
fn enter_lean(at: u32, half: u32, t_max: f32) -> vec4<u32> {
    var near = vec4<f32>(space.t_min);
    var far = vec4<f32>(t_max);
    for (var k = 0u; k < 3u; k += 1u) {
        let q = at + 10u * k;
        let x = quad(q);
        let y = quad(q + 2u);
        let z = quad(q + 4u);
        let p = x * space.origin.x + (y * space.origin.y + (z * space.origin.z - quad(q + 6u)));
        let d = x * space.direction.x + (y * space.direction.y + z * space.direction.z);
        let h = quad(q + 8u) + vec4<f32>(space.pad_lean);
        let a = guarded_reciprocals(d);
        let middle = select(p, -p, d < vec4<f32>(0.0)) * a;
        near = max(-(h * a) - middle, near);
        far = min(h * a - middle, far);
    }
    return keys(near, far, half);
}

/// `1/|d|`, bounded.
fn guarded_reciprocals(d: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(1.0) / max(abs(d), vec4<f32>(LEAST_DIRECTION));
}
