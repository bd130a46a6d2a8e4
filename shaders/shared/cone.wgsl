// The part of space that a ray stands for: a narrow cone about it, whose width decides how much of a texture it sees.
// use shared/numbers

struct Cone {
    /// Diameter at the origin of the ray, world units.
    width: f32,
    /// Growth of the diameter with distance.
    spread: f32,
    /// The part of a pixel, or of what a surface scatters to, that the sample stands for: a ratio of lengths.
    scale: f32,
    /// Whether nothing but mirrors lies between the ray and the camera.
    is_direct: bool,
}

/// The cone of a pixel's sample with this number: `width` and `spread` are those of the pixel.
fn cone_of_pixel(width: f32, spread: f32, sample: u32) -> Cone {
    let scale = inverseSqrt(f32(sample) + 1.0);
    return Cone(width * scale, spread * scale, scale, true);
}

/// The same cone further along the ray, by world units.
fn grown(cone: Cone, distance: f32) -> Cone {
    return Cone(cone.width + cone.spread * distance, cone.spread, cone.scale, cone.is_direct);
}

/// The cone about a direction that a surface scattered to, which was chosen with a density per steradian.
fn scattered(cone: Cone, density: f32) -> Cone {
    // At most a half sphere's projection, that of a diffuse surface.
    let solid_angle = 1.0 / max(density, 1.0 / PI);
    let spread = sqrt(cone.spread * cone.spread + solid_angle * cone.scale * cone.scale);
    return Cone(cone.width, spread, cone.scale, false);
}
