// choice both
// Local lights are emissive triangles and listed lights.
// use shared/light/emitters
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

// choice emitters
// Local lights are emissive triangles only.
// use shared/light/emitters
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

// choice lights
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

// choice none
// No local lights.
// use shared/light/sample

fn sample_local(receiver: Receiver, choice: f32, square: vec2<f32>) -> LightSample {
    return no_light();
}

fn emitter_density(receiver: Receiver, instance: u32, primitive: u32, direction: vec3<f32>) -> f32 {
    return 0.0;
}

fn shape_density(receiver: Receiver, number: u32, direction: vec3<f32>) -> f32 {
    return 0.0;
}
