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
