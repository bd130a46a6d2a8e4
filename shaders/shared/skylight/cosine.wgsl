// The sky sampled by the cosine to the shading normal: for one that is the same from everywhere.
// use shared/sampling
// use shared/light/receiver
// use shared/light/sample
// use ?sky

/// Light from the sky.
fn sample_sky(receiver: Receiver, square: vec2<f32>) -> LightSample {
    let local = cosine_hemisphere(square);
    let to_light = basis_about(receiver.shading_normal) * local;
    let density = cosine_density(local.z);
    let radiance = bounded(sky_radiance(to_light) * quotient(1.0, density));
    return LightSample(IncomingLight(to_light, density, radiance, INFINITE, vec3(0.0)), NO_SHAPE_LIGHT, false);
}

/// Density of `sample_sky` in a unit direction.
fn sky_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    return cosine_density(dot(receiver.shading_normal, direction));
}
