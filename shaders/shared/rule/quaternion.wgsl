// Axes of a node: the rotation between its children's, by area.
// use shared/build/average

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return average_frame(a, b);
}
