// choice both
// Lights that have a place are triangles that emit, and of the list.
// use shared/light/emitters
// use shared/light/list/sampled
// use shared/light/tree

/// Light from one light that has a place.
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
// All lights that have a place are triangles that emit.
// use shared/light/emitters
// use shared/light/tree

/// Light from one light that has a place.
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
// All lights that have a place are of the list.
// use shared/light/list/sampled
// use shared/light/tree

/// Light from one light that has a place.
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
// No light has a place.
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
