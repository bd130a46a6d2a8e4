// Lights that have a place are triangles that emit, and of the list.
// use shared/light/emitters
// use shared/light/listed
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
