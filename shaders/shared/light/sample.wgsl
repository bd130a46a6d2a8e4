// A point that receives light.

struct Receiver {
    position: vec3<f32>,
    /// Whether light from behind the triangle counts.
    transmits: bool,
    /// Unit normal of the triangle.
    normal: vec3<f32>,
    /// Unit shading normal.
    shading_normal: vec3<f32>,
}

// Samples of the light from one direction.
// use shared/light/incoming

/// Contribution of a sampled light, and its shadow ray.
struct LightSample {
    /// Radiance over the density of the choice. The density is 0 for a light without extent, which no other technique samples.
    incoming: IncomingLight,
    /// Index of the shape light; `NO_SHAPE_LIGHT` for other lights.
    shape_light: u32,
    /// Whether it is the emission of a surface.
    is_emission: bool,
}

const NO_SHAPE_LIGHT: u32 = 0xffffffffu;

fn no_light() -> LightSample {
    return LightSample(no_incoming_light(), NO_SHAPE_LIGHT, false);
}

/// A sample of a light chosen with this probability.
fn chosen_with(probability: f32, found: LightSample) -> LightSample {
    var sample = found;
    sample.incoming.radiance = bounded(found.incoming.radiance * quotient(1.0, probability));
    sample.incoming.density = found.incoming.density * probability;
    return sample;
}
