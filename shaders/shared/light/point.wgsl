// Point lights; twin of crates/renderer/src/light/point.rs.
// use shared/numbers
// use shared/light/list

fn incoming_from_point(light: ListLight, at: vec3<f32>) -> IncomingLight {
    let delta = light.position - at;
    let distance_squared = dot(delta, delta);
    if distance_squared < MIN_SQUARE {
        return no_incoming_light();
    }
    return incoming_along(light, delta / sqrt(distance_squared), distance_squared, 1.0);
}

/// Light from the position of a light along a unit vector, with a factor of its intensity.
fn incoming_along(light: ListLight, to_light: vec3<f32>, distance_squared: f32, falloff: f32) -> IncomingLight {
    let factor = quotient(falloff, distance_squared);
    if factor <= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(to_light, 0.0, bounded(light.color * factor), FINITE, light.position);
}
