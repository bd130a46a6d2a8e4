// Rotations as quaternions: x, y, z, w.
// use shared/build/frame

/// Square root of one half.
const ROOT_HALF: f32 = 0.70710678;

/// Rotation by `q`, then by `p`.
fn product(p: vec4<f32>, q: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(p.w * q.xyz + q.w * p.xyz + cross(p.xyz, q.xyz), p.w * q.w - dot(p.xyz, q.xyz));
}

/// The rotation of right-handed orthonormal axes; divides by the largest component (Shepperd 1978).
fn quaternion_of(axes: mat3x3<f32>) -> vec4<f32> {
    let trace = axes[0].x + axes[1].y + axes[2].z;
    let squares = vec4<f32>(
        1.0 + 2.0 * axes[0].x - trace,
        1.0 + 2.0 * axes[1].y - trace,
        1.0 + 2.0 * axes[2].z - trace,
        1.0 + trace,
    );
    let turn = vec3<f32>(axes[1].z - axes[2].y, axes[2].x - axes[0].z, axes[0].y - axes[1].x);
    let xy = axes[1].x + axes[0].y;
    let xz = axes[2].x + axes[0].z;
    let yz = axes[2].y + axes[1].z;
    let largest = max(max(squares.x, squares.y), max(squares.z, squares.w));
    if largest == squares.w {
        return normalize(vec4<f32>(turn, squares.w));
    }
    if largest == squares.x {
        return normalize(vec4<f32>(squares.x, xy, xz, turn.x));
    }
    if largest == squares.y {
        return normalize(vec4<f32>(xy, squares.y, yz, turn.y));
    }
    return normalize(vec4<f32>(xz, yz, squares.z, turn.z));
}

/// The axes of a unit quaternion, orthonormalized.
fn axes_of(q: vec4<f32>) -> mat3x3<f32> {
    let x = vec3<f32>(1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y));
    let y = vec3<f32>(2.0 * (q.x * q.y - q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z + q.w * q.x));
    return axes_along(x, y);
}

/// The rotational symmetry of the cube nearest to `r`: along its largest component, its two largest, or all four.
fn nearest_symmetry(r: vec4<f32>) -> vec4<f32> {
    let size = abs(r);
    var first = 0u;
    for (var k = 1u; k < 4u; k++) {
        if size[k] > size[first] {
            first = k;
        }
    }
    var second = select(0u, 1u, first == 0u);
    for (var k = 1u; k < 4u; k++) {
        if k != first && size[k] > size[second] {
            second = k;
        }
    }
    let one = size[first];
    let two = (one + size[second]) * ROOT_HALF;
    let four = 0.5 * (size.x + size.y + size.z + size.w);
    let signs = select(vec4<f32>(1.0), vec4<f32>(-1.0), r < vec4<f32>(0.0));
    if four > one && four > two {
        return 0.5 * signs;
    }
    var nearest = vec4<f32>(0.0);
    nearest[first] = 1.0;
    if two > one {
        nearest[first] = ROOT_HALF;
        nearest[second] = ROOT_HALF;
    }
    return nearest * signs;
}

/// Weighted mean of two frames, after the symmetry of the box that brings the second nearest to the first.
/// Source: Ericson 2004, 6.5.3, made robust; for equal weights the chordal mean (Markley et al. 2007).
fn axes_between(a: mat3x3<f32>, b: mat3x3<f32>, weights: vec2<f32>) -> mat3x3<f32> {
    let p = quaternion_of(a);
    let q = quaternion_of(b);
    let conjugate = vec4<f32>(-q.xyz, q.w);
    let near = product(q, nearest_symmetry(product(conjugate, p)));
    let sum = weights.x + weights.y;
    let share = select(vec2(0.5), weights / max(sum, 1e-37), sum > 1e-36);
    return axes_of(normalize(p * share.x + near * share.y));
}
