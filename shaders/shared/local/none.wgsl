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
