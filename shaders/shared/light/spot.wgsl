// Spot lights; twin of crates/renderer/src/light/spot.rs.
// use shared/numbers
// use shared/light/list
// use shared/light/point

fn incoming_from_spot(light: ListLight, at: vec3<f32>) -> IncomingLight {
    let delta = light.position - at;
    let distance_squared = dot(delta, delta);
    if distance_squared < MIN_SQUARE {
        return no_incoming_light();
    }
    let to_light = delta / sqrt(distance_squared);
    let falloff = spot_falloff(-dot(light.direction, to_light), light.extent, light.cos_outer);
    return incoming_along(light, to_light, distance_squared, falloff);
}

/// Falloff of a spot light at a cosine to its axis.
fn spot_falloff(cosine: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cosine >= cos_inner {
        return 1.0;
    }
    if cosine <= cos_outer {
        return 0.0;
    }
    let linear = (cosine - cos_outer) / (cos_inner - cos_outer);
    return linear * linear;
}
