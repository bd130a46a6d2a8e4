// Orthonormal axes.
// use shared/build/content

/// A projected vector shorter than this fraction of its length is rounding error, not a direction.
const PARALLEL: f32 = 1e-5;

/// A unit vector perpendicular to the unit vector `x`.
fn across(x: vec3<f32>) -> vec3<f32> {
    let size = abs(x);
    if size.x <= size.y && size.x <= size.z {
        return normalize(vec3<f32>(0.0, -x.z, x.y));
    }
    if size.y <= size.z {
        return normalize(vec3<f32>(x.z, 0.0, -x.x));
    }
    return normalize(vec3<f32>(-x.y, x.x, 0.0));
}

/// Right-handed axes: the first along `first`, the second in the plane of both arguments, whose lengths must be near one.
/// Returns the identity if `first` is zero and any second axis if the arguments are parallel.
fn axes_along(first: vec3<f32>, second: vec3<f32>) -> mat3x3<f32> {
    if !(dot(first, first) > 1e-12) {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let x = normalize(first);
    let rest = second - x * dot(second, x);
    var y = across(x);
    if dot(rest, rest) > PARALLEL * PARALLEL {
        // A short remainder carries the rounding of the projection; a second projection removes it.
        let unit = normalize(rest);
        y = normalize(unit - x * dot(unit, x));
    }
    return mat3x3<f32>(x, y, cross(x, y));
}

/// Axes of a triangle: along its longest edge, in its plane, and the normal. `size` is a length of similar magnitude.
fn triangle_axes(corners: mat3x3<f32>, size: f32) -> mat3x3<f32> {
    let ab = (corners[1] - corners[0]) / size;
    let bc = (corners[2] - corners[1]) / size;
    let ca = (corners[0] - corners[2]) / size;
    let lengths = vec3<f32>(dot(ab, ab), dot(bc, bc), dot(ca, ca));
    if lengths.x >= lengths.y && lengths.x >= lengths.z {
        return axes_along(ab, bc);
    }
    if lengths.y >= lengths.z {
        return axes_along(bc, ca);
    }
    return axes_along(ca, ab);
}
