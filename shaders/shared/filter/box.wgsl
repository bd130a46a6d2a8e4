// A filter that weighs all of its square alike.

/// Where a sample lies from the pixel's centre, in pixels, for a point of the unit square.
fn filtered(square: vec2<f32>) -> vec2<f32> {
    return picture.filter_radius * (2.0 * square - 1.0);
}
