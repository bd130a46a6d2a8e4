// One light chosen for a point, and how likely the choice was; twin of crates/renderer/src/light/sampler.rs.
//
// `?local` are the lights that have a place, `?skylight` the sky, `?suns` what shines from one direction.
// use shared/light/sample
// use ?local
// use ?skylight
// use ?suns

/// What is chosen first: shares that are the same everywhere, of all lights that have a place and of the sky. Suns have
/// the rest.
struct LightShares {
    local: f32,
    sky: f32,
}

@group(3) @binding(6) var<uniform> light_shares: LightShares;

/// Light that would arrive at a receiver, from a number in `[0, 1)` that chooses and a point of the unit square.
fn sample_light(receiver: Receiver, choice: f32, square: vec2<f32>) -> LightSample {
    if choice < light_shares.local {
        let rest = min(choice / light_shares.local, 0.99999994);
        return chosen_with(light_shares.local, sample_local(receiver, rest, square));
    }
    let rest = choice - light_shares.local;
    if rest < light_shares.sky {
        return chosen_with(light_shares.sky, sample_sky(receiver, square));
    }
    return sample_sun(rest - light_shares.sky);
}

/// Density with which `sample_light` finds the sky in a unit direction.
fn sky_light_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    return light_shares.sky * sky_density(receiver, direction);
}

/// Density with which `sample_light` finds a unit direction that meets a triangle.
fn surface_light_density(receiver: Receiver, instance: u32, primitive: u32, direction: vec3<f32>) -> f32 {
    return light_shares.local * emitter_density(receiver, instance, primitive, direction);
}

/// Density with which `sample_light` finds a unit direction that meets a body of the list.
fn shape_light_density(receiver: Receiver, number: u32, direction: vec3<f32>) -> f32 {
    return light_shares.local * shape_density(receiver, number, direction);
}
