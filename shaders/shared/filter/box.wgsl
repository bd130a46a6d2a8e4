// A filter that weighs all of its square alike.

struct Filtered {
    /// From the pixel's centre, in pixels.
    offset: vec2<f32>,
    weight: f32,
}

/// Where a sample lies for a point of the unit square.
fn filtered(square: vec2<f32>) -> Filtered {
    return Filtered(picture.filter_radius * (2.0 * square - 1.0), 1.0);
}
