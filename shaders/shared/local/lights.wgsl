// All lights that have a place are of the list.
// use shared/light/listed
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
