// choice perspective
// Perspective projection.

/// The ray through a position in pixels relative to the center of the picture.
fn line_of(position: vec2<f32>) -> Ray {
    let direction = picture.forward + (position.x * picture.right + position.y * picture.down);
    // At least as long as the unit vector forward, to which the other two are perpendicular.
    return infinite_ray(picture.eye, normalize(direction));
}

/// The cone of a pixel: its spread is the root of the pixel's solid angle.
fn pixel_cone(position: vec2<f32>, sample: u32) -> Cone {
    let offset = position * picture.pixel;
    // The image plane is at distance 1: the solid angle falls with the squared distance and the cosine.
    let cosine = inverseSqrt(1.0 + dot(offset, offset));
    return cone_of_pixel(0.0, picture.pixel * cosine * sqrt(cosine), sample);
}

// choice orthographic
// Orthographic projection.

/// The ray through a position in pixels relative to the center of the picture.
fn line_of(position: vec2<f32>) -> Ray {
    return infinite_ray(picture.eye + (position.x * picture.right + position.y * picture.down), picture.forward);
}

/// The cone of a pixel.
fn pixel_cone(position: vec2<f32>, sample: u32) -> Cone {
    return cone_of_pixel(picture.pixel, 0.0, sample);
}
