// Directional lights; twin of crates/renderer/src/light/sun.rs.
// use shared/light/list

fn incoming_from_sun(light: ListLight) -> IncomingLight {
    return IncomingLight(-light.direction, 0.0, bounded(light.color), INFINITE, vec3(0.0));
}

// choice suns/none
// No suns.
// use shared/light/sampler

fn sample_sun(choice: f32) -> LightSample {
    return no_light();
}

// choice suns/list
// Suns, chosen with probabilities that are the same for all points.
// use shared/light/list/lights
// use shared/light/sampler
// use shared/invocation/iterations

/// A sun and the probability with which it is chosen.
struct SampledSun {
    /// Index in the list of lights.
    light: u32,
    probability: f32,
}

@group(3) @binding(9) var<storage, read> sampled_suns: array<SampledSun>;

/// Samples the sun whose interval contains a number; the last one also covers the rounding error.
fn sample_sun(choice: f32) -> LightSample {
    let last = arrayLength(&sampled_suns) - 1u;
    var number = 0u;
    var rest = choice;
    loop {
        iterations += 1u;
        if number >= last || rest < sampled_suns[number].probability {
            break;
        }
        rest -= sampled_suns[number].probability;
        number++;
    }
    let sun = sampled_suns[number];
    let incoming = incoming_light(lights[sun.light], vec3(0.0), vec2(0.0));
    return chosen_with(sun.probability, LightSample(incoming, sun.light, false));
}
