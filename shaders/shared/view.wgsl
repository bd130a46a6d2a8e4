// choice perspective
// Lines through one point.

/// Through a position in pixels from the middle of the picture, and the middle of the lens.
fn line_of(position: vec2<f32>) -> Ray {
    let direction = picture.forward + (position.x * picture.right + position.y * picture.down);
    // At least as long as the unit vector forward, to which the other two are perpendicular.
    return endless(picture.eye, normalize(direction));
}

/// What the ray through a position stands for; a pixel fills a solid angle, and the spread is its root.
fn pixel_cone(position: vec2<f32>, sample: u32) -> Cone {
    let place = position * picture.pixel;
    // The plane of the picture is at distance 1: a pixel's angle falls by the square of the distance and the cosine.
    let cosine = inverseSqrt(1.0 + dot(place, place));
    return cone_of_pixel(0.0, picture.pixel * cosine * sqrt(cosine), sample);
}

// choice orthographic
// Parallel lines.

/// Through a position in pixels from the middle of the picture.
fn line_of(position: vec2<f32>) -> Ray {
    return endless(picture.eye + (position.x * picture.right + position.y * picture.down), picture.forward);
}

/// What the ray through a position stands for.
fn pixel_cone(position: vec2<f32>, sample: u32) -> Cone {
    return cone_of_pixel(picture.pixel, 0.0, sample);
}
