// part average
// The mean of the frames of two children.
// use shared/build/quaternion
// use shared/build/bounded

/// Frame of a child. The axes of a sheared box are orthonormalized in order.
fn axes_of_child(content: Content, size: f32) -> mat3x3<f32> {
    if content.is_box {
        let x = content.columns[0];
        let y = content.columns[1];
        return axes_along(x / max(length_1(x), 1e-30), y / max(length_1(y), 1e-30));
    }
    return triangle_axes(content.columns, size);
}

fn average_frame(a: Content, b: Content) -> mat3x3<f32> {
    let size = size_of(a, b);
    if !(size > 1e-30) {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let areas = vec2<f32>(content_area(a), content_area(b));
    return axes_between(axes_of_child(a, size), axes_of_child(b, size), areas);
}

// choice pca_bounded
// Frame of a node: principal axes of the corners of its children.
// use shared/build/bounded

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return bounded_frame(a, b);
}

// choice quaternion
// Frame of a node: area-weighted mean of the children's rotations.
// use shared/rule/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return average_frame(a, b);
}

// choice combined
// Frame of a node by kind of child: mean rotation for two boxes, principal axes otherwise. Source: Sabino 2020, 3.5.
// use shared/rule/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    if a.is_box && b.is_box {
        return average_frame(a, b);
    }
    return bounded_frame(a, b);
}
