// Light from one direction, chosen among all.
// use shared/light/arrival
// use shared/light/receiver

/// What a sample of light is worth, and what must be clear for it to arrive.
struct LightSample {
    /// Radiance over the density of its choice; its density is 0 for a light without extent, which no other technique
    /// finds.
    arrival: Arrival,
    /// Number of the body it comes from; `NO_BODY` for what is none.
    body: u32,
    /// Whether it is the emission of a surface.
    is_emission: bool,
}

const NO_BODY: u32 = 0xffffffffu;

fn no_light() -> LightSample {
    return LightSample(no_arrival(), NO_BODY, false);
}

/// A sample of a light that was chosen with a probability.
fn chosen_with(probability: f32, found: LightSample) -> LightSample {
    var sample = found;
    sample.arrival.radiance = bounded(found.arrival.radiance * quotient(1.0, probability));
    sample.arrival.density = found.arrival.density * probability;
    return sample;
}
