// Chooses one light for a point, with the probability of the choice; twin of crates/renderer/src/light/sampler.rs.
//
// `?local` are lights with a position, `?skylight` the sky, `?suns` directional lights.
// use shared/light/sample
// use ?local
// use ?skylight
// use ?suns

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
