// Orthonormal axes.
// use shared/build/content

/// Below this share of its length a vector left by projection is rounding, not direction.
const PARALLEL: f32 = 1e-5;

/// A unit vector at right angles to the unit vector `x`: across its least component.
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

/// The right-handed axes whose first is along `first` and whose second lies in the plane of both; both of lengths near one.
/// The axes of the space for a first of zero, any second for one that is parallel.
fn axes_along(first: vec3<f32>, second: vec3<f32>) -> mat3x3<f32> {
    if !(dot(first, first) > 1e-12) {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let x = normalize(first);
    let rest = second - x * dot(second, x);
    var y = across(x);
    if dot(rest, rest) > PARALLEL * PARALLEL {
        // A short rest carries the rounding of the projection; a second one removes it.
        let unit = normalize(rest);
        y = normalize(unit - x * dot(unit, x));
    }
    return mat3x3<f32>(x, y, cross(x, y));
}

/// A triangle's axes: along its longest edge, in its plane, across it. `size` is a length near its own.
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
