// A point that receives light.

struct Receiver {
    position: vec3<f32>,
    /// Whether light from behind the triangle counts.
    transmits: bool,
    /// Unit normal of the triangle.
    normal: vec3<f32>,
    /// Unit normal to shade with.
    shading_normal: vec3<f32>,
}

// Light from one direction, chosen among all.
// use shared/light/incoming

/// What a sample of light is worth, and what must be clear for it to arrive.
struct LightSample {
    /// Radiance over the density of its choice; its density is 0 for a light without extent, which no other technique
    /// finds.
    incoming: IncomingLight,
    /// Number of the body it comes from; `NO_SHAPE_LIGHT` for what is none.
    shape_light: u32,
    /// Whether it is the emission of a surface.
    is_emission: bool,
}

const NO_SHAPE_LIGHT: u32 = 0xffffffffu;

fn no_light() -> LightSample {
    return LightSample(no_incoming_light(), NO_SHAPE_LIGHT, false);
}

/// A sample of a light that was chosen with a probability.
fn chosen_with(probability: f32, found: LightSample) -> LightSample {
    var sample = found;
    sample.incoming.radiance = bounded(found.incoming.radiance * quotient(1.0, probability));
    sample.incoming.density = found.incoming.density * probability;
    return sample;
}
