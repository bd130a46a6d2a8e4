// Sphere lights; twin of crates/renderer/src/light/sphere.rs.
//
// Close to a sphere the cap height changes with the square root of the distance, and so does its error.
// use shared/numbers
// use shared/angle
// use shared/sampling
// use shared/light/list

/// One minus the cosine of the half-angle under which a point sees a sphere; 0 from inside.
fn cap_height(radius: f32, distance: f32) -> f32 {
    if distance <= radius {
        return 0.0;
    }
    let sine = radius / distance;
    // As a product, to keep precision for near and far points.
    let cosine = sqrt((1.0 - sine) * (1.0 + sine));
    return sine * sine / (1.0 + cosine);
}

/// Samples the cone in which the point sees the sphere, uniformly in solid angle.
fn incoming_from_sphere(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    let delta = light.position - at;
    let distance = length(delta);
    let height = cap_height(light.extent, distance);
    if height <= 0.0 {
        return no_incoming_light();
    }
    let below = square.x * height;
    let cosine = 1.0 - below;
    let sine_squared = below * (2.0 - below);
    // Half of the chord that the sphere cuts from the ray. Rounding may make it negative at the silhouette.
    let sine = sqrt(sine_squared);
    let across = distance * sine;
    let half_chord = sqrt(max((light.extent - across) * (light.extent + across), 0.0));
    let to_light = basis_about(delta / distance) * vec3(sine * circle(square.y), cosine);
    let point = at + to_light * (distance * cosine - half_chord);
    let solid_angle = TAU * height;
    return IncomingLight(to_light, quotient(1.0, solid_angle), bounded(light.color * solid_angle), FINITE, point);
}

/// Density of `incoming_from_sphere` for all directions that hit the sphere; 0 from inside.
fn sphere_density(light: ListLight, at: vec3<f32>) -> f32 {
    let height = cap_height(light.extent, length(light.position - at));
    return select(0.0, quotient(1.0, TAU * height), height > 0.0);
}

// part hit
// use shared/numbers

/// The discriminant uses the distance from the center to the line, so small and far spheres keep precision (Haines et al.
/// 2019).
fn sphere_crossing(light: ListLight, ray: Ray) -> Crossing {
    let from_center = ray.origin - light.position;
    let d_squared = dot(ray.direction, ray.direction);
    let closest = -dot(from_center, ray.direction) / max(d_squared, MIN_SQUARE);
    let distance = length(from_center + closest * ray.direction);
    let chord_squared = (light.extent - distance) * (light.extent + distance);
    if chord_squared < 0.0 || d_squared < MIN_SQUARE {
        return Crossing(NO_CROSSING, false);
    }
    let half_chord = sqrt(chord_squared / d_squared);
    let enters = closest - half_chord;
    if ray.t_min <= enters && enters <= ray.t_max {
        return Crossing(enters, true);
    }
    let leaves = closest + half_chord;
    let is_within = ray.t_min <= leaves && leaves <= ray.t_max;
    return Crossing(select(NO_CROSSING, leaves, is_within), false);
}
