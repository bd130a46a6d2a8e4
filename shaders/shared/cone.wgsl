// Ray cones, whose width selects the texture level.
// use shared/numbers

struct Cone {
    /// Diameter at the origin of the ray, in world units.
    width: f32,
    /// Growth of the diameter with distance.
    spread: f32,
    /// Fraction of a pixel, or of a scattering lobe, that the sample represents, as a ratio of lengths.
    scale: f32,
    /// Whether only mirrors lie between the ray and the camera.
    is_direct: bool,
}

/// The cone of the pixel sample with this index; `width` and `spread` are those of the pixel.
fn cone_of_pixel(width: f32, spread: f32, sample: u32) -> Cone {
    let scale = inverseSqrt(f32(sample) + 1.0);
    return Cone(width * scale, spread * scale, scale, true);
}

/// The cone after `distance` world units.
fn grown(cone: Cone, distance: f32) -> Cone {
    return Cone(cone.width + cone.spread * distance, cone.spread, cone.scale, cone.is_direct);
}

/// The cone of a scattered direction sampled with this density per steradian.
fn scattered(cone: Cone, density: f32) -> Cone {
    // At most the projected hemisphere, as for a diffuse surface.
    let solid_angle = 1.0 / max(density, 1.0 / PI);
    let spread = sqrt(cone.spread * cone.spread + solid_angle * cone.scale * cone.scale);
    return Cone(cone.width, spread, cone.scale, false);
}
