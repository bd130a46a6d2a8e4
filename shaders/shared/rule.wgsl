// part average
// Axes between those of two children.
// use shared/build/quaternion
// use shared/build/bounded

/// Axes of a child; those of a box that a shear left are made orthonormal in turn.
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
// Axes of a node: principal axes of its children's corners.
// use shared/build/bounded

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return bounded_frame(a, b);
}

// choice quaternion
// Axes of a node: the rotation between its children's, by area.
// use shared/rule/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return average_frame(a, b);
}

// choice combined
// Axes of a node by kind of child: the rotation between two boxes, principal axes where a leaf is.
// Source: Sabino 2020, 3.5.
// use shared/rule/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    if a.is_box && b.is_box {
        return average_frame(a, b);
    }
    return bounded_frame(a, b);
}
