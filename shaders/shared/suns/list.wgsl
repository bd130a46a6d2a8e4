// Suns of the list, each chosen with a share that is the same everywhere.
// use shared/light/lights
// use shared/light/sample
// use shared/iterations

struct SunShare {
    /// Number of the list.
    light: u32,
    share: f32,
}

@group(3) @binding(9) var<storage, read> sun_shares: array<SunShare>;

/// Light of the sun in whose share a number falls; the last has what rounding leaves.
fn sample_sun(choice: f32) -> LightSample {
    let last = arrayLength(&sun_shares) - 1u;
    var number = 0u;
    var rest = choice;
    loop {
        iterations += 1u;
        if number >= last || rest < sun_shares[number].share {
            break;
        }
        rest -= sun_shares[number].share;
        number++;
    }
    let sun = sun_shares[number];
    let incoming = incoming_light(lights[sun.light], vec3(0.0), vec2(0.0));
    return chosen_with(sun.share, LightSample(incoming, sun.light, false));
}
