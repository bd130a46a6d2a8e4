// Emitters whose radiance is the same all over, and that alpha does not cut out.

fn emitted_by(emitter: Emitter, weights: vec2<f32>, direction: vec3<f32>) -> vec3<f32> {
    return emitter.radiance;
}
