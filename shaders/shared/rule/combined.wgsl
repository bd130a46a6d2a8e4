// Axes of a node by kind of child: the rotation between two boxes, principal axes where a leaf is.
// Source: Sabino 2020, 3.5.
// use shared/build/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    if a.is_box && b.is_box {
        return average_frame(a, b);
    }
    return bounded_frame(a, b);
}
