// There is no sky to sample.
// use shared/light/sample

fn sample_sky(receiver: Receiver, square: vec2<f32>) -> LightSample {
    return no_light();
}

fn sky_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    return 0.0;
}
