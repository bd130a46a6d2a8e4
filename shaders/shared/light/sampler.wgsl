// Chooses one light for a point, with the probability of the choice; twin of crates/renderer/src/light/sampler.rs.
//
// `?local` are lights with a position, `?skylight` the sky, `?suns` directional lights.
// use shared/light/list
// use ?local
// use ?skylight
// use ?suns

/// A point that receives light.
struct Receiver {
    position: vec3<f32>,
    /// Whether light from behind the triangle counts.
    transmits: bool,
    /// Unit normal of the triangle.
    normal: vec3<f32>,
    /// Unit shading normal.
    shading_normal: vec3<f32>,
}

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

/// Probabilities of the first choice, the same for all points: local lights and the sky. Suns have the rest.
struct LightProbabilities {
    local: f32,
    sky: f32,
}

@group(3) @binding(6) var<uniform> light_probabilities: LightProbabilities;

/// Samples the light at a receiver, from a number in `[0, 1)` that chooses and a point of the unit square.
fn sample_light(receiver: Receiver, choice: f32, square: vec2<f32>) -> LightSample {
    if choice < light_probabilities.local {
        let rest = min(choice / light_probabilities.local, 0.99999994);
        return chosen_with(light_probabilities.local, sample_local(receiver, rest, square));
    }
    let rest = choice - light_probabilities.local;
    if rest < light_probabilities.sky {
        return chosen_with(light_probabilities.sky, sample_sky(receiver, square));
    }
    return sample_sun(rest - light_probabilities.sky);
}

/// Density of the sky in a unit direction under `sample_light`.
fn sky_light_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    return light_probabilities.sky * sky_density(receiver, direction);
}

/// Density of a unit direction that hits a triangle under `sample_light`.
fn surface_light_density(receiver: Receiver, instance: u32, primitive: u32, direction: vec3<f32>) -> f32 {
    return light_probabilities.local * emitter_density(receiver, instance, primitive, direction);
}

/// Density of a unit direction that hits a shape light under `sample_light`.
fn shape_light_density(receiver: Receiver, number: u32, direction: vec3<f32>) -> f32 {
    return light_probabilities.local * shape_density(receiver, number, direction);
}

// choice local/both
// Local lights are emissive triangles and listed lights.
// use shared/light/triangle
// use shared/light/list/sampled
// use shared/light/tree

/// Samples one local light.
fn sample_local(receiver: Receiver, choice: f32, square: vec2<f32>) -> LightSample {
    let chosen = choose_light(receiver, choice);
    if chosen.probability <= 0.0 {
        return no_light();
    }
    if (chosen.light & EMITTER) != 0u {
        return chosen_with(chosen.probability, sample_emitter(chosen.light & ~EMITTER, receiver.position, square));
    }
    return chosen_with(chosen.probability, sample_listed(chosen.light, receiver.position, square));
}

// choice local/emitters
// Local lights are emissive triangles only.
// use shared/light/triangle
// use shared/light/tree

/// Samples one local light.
fn sample_local(receiver: Receiver, choice: f32, square: vec2<f32>) -> LightSample {
    let chosen = choose_light(receiver, choice);
    if chosen.probability <= 0.0 {
        return no_light();
    }
    return chosen_with(chosen.probability, sample_emitter(chosen.light & ~EMITTER, receiver.position, square));
}

fn shape_density(receiver: Receiver, number: u32, direction: vec3<f32>) -> f32 {
    return 0.0;
}

// choice local/lights
// Local lights are listed lights only.
// use shared/light/list/sampled
// use shared/light/tree

/// Samples one local light.
fn sample_local(receiver: Receiver, choice: f32, square: vec2<f32>) -> LightSample {
    let chosen = choose_light(receiver, choice);
    if chosen.probability <= 0.0 {
        return no_light();
    }
    return chosen_with(chosen.probability, sample_listed(chosen.light, receiver.position, square));
}

fn emitter_density(receiver: Receiver, instance: u32, primitive: u32, direction: vec3<f32>) -> f32 {
    return 0.0;
}

// choice local/none
// No local lights.

fn sample_local(receiver: Receiver, choice: f32, square: vec2<f32>) -> LightSample {
    return no_light();
}

fn emitter_density(receiver: Receiver, instance: u32, primitive: u32, direction: vec3<f32>) -> f32 {
    return 0.0;
}

fn shape_density(receiver: Receiver, number: u32, direction: vec3<f32>) -> f32 {
    return 0.0;
}
