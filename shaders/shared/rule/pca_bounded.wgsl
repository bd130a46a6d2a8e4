// Axes of a node: principal axes of its children's corners.
// use shared/build/bounded

fn frame_of(a: Content, b: Content) -> mat3x3<f32> {
    return bounded_frame(a, b);
}
