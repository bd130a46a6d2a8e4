// Parallel lines.

/// Through a position in pixels from the middle of the picture.
fn line_of(position: vec2<f32>) -> Ray {
    return endless(picture.eye + (position.x * picture.right + position.y * picture.down), picture.forward);
}

/// What the ray through a position stands for.
fn pixel_cone(position: vec2<f32>, sample: u32) -> Cone {
    return cone_of_pixel(picture.pixel, 0.0, sample);
}
