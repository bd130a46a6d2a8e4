// Unoccluded light from a listed light to a point; twin of crates/renderer/src/light/incoming.rs.
//
// All in f32. Results have a relative error of a few ULP of the largest coordinate over the distance, as the input has. Close
// to a sphere the cap height changes with the square root of the distance, and so does its error.
// use shared/numbers
// use shared/angle
// use shared/sampling
// use shared/light/list

/// No light.
const NO_LIGHT: u32 = 0u;
/// The shadow ray ends at `position`.
const FINITE: u32 = 1u;
/// The shadow ray along `to_light` is infinite.
const INFINITE: u32 = 2u;

/// Light that would arrive at a point.
struct IncomingLight {
    /// Unit vector.
    to_light: vec3<f32>,
    /// Density of `to_light` per steradian; 0 for a light without extent.
    density: f32,
    /// Radiance over density; for a light without extent, the irradiance on a surface that faces it.
    radiance: vec3<f32>,
    /// The shadow ray: `NO_LIGHT`, `FINITE` or `INFINITE`.
    shadow_ray: u32,
    /// Position on the light, for a finite shadow ray.
    position: vec3<f32>,
}

fn no_incoming_light() -> IncomingLight {
    return IncomingLight(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), NO_LIGHT, vec3(0.0));
}

/// Light from a listed light to a point. Only lights with an extent use `square`.
fn incoming_light(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    switch light.kind {
        case SUN: { return IncomingLight(-light.direction, 0.0, bounded(light.color), INFINITE, vec3(0.0)); }
        case SPHERE: { return incoming_from_sphere(light, at, square); }
        case DISK: { return incoming_from_disk(light, at, square); }
        default: { return incoming_from_point(light, at); }
    }
}

fn incoming_from_point(light: ListLight, at: vec3<f32>) -> IncomingLight {
    let delta = light.position - at;
    let distance_squared = dot(delta, delta);
    if distance_squared < MIN_SQUARE {
        return no_incoming_light();
    }
    let to_light = delta / sqrt(distance_squared);
    var falloff = 1.0;
    if light.kind == SPOT {
        falloff = spot_falloff(-dot(light.direction, to_light), light.extent, light.cos_outer);
    }
    let factor = quotient(falloff, distance_squared);
    if factor <= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(to_light, 0.0, bounded(light.color * factor), FINITE, light.position);
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

/// Samples a disk uniformly by area; its back does not emit.
fn incoming_from_disk(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    let point = light.position + basis_about(light.direction) * vec3(light.extent * uniform_disk(square), 0.0);
    let delta = point - at;
    let density = area_density(delta, light.direction, PI * light.extent * light.extent);
    if density <= 0.0 || dot(delta, light.direction) >= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(normalize(delta), density, bounded(light.color * quotient(1.0, density)), FINITE, point);
}

/// Density of `incoming_from_disk` for a unit direction that hits the disk; 0 from behind.
fn disk_density(light: ListLight, at: vec3<f32>, direction: vec3<f32>) -> f32 {
    if dot(direction, light.direction) >= 0.0 {
        return 0.0;
    }
    return plane_density(at, direction, light.position, light.direction, PI * light.extent * light.extent);
}

/// Density per steradian of a uniform point of a planar shape, from the vector to it; 0 if seen edge-on.
fn area_density(delta: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let distance_squared = dot(delta, delta);
    let height = abs(dot(delta, unit_normal));
    // dA * cos = r^2 * dw, and r * cos is the height above the plane.
    if distance_squared < MIN_SQUARE || height < 1e-18 * sqrt(distance_squared) {
        return 0.0;
    }
    let stretch = min(sqrt(distance_squared) / height, MAX_QUOTIENT);
    return min(quotient(distance_squared, area) * stretch, MAX_QUOTIENT);
}

/// The same for the point where a unit direction hits the plane; 0 for a miss.
fn plane_density(at: vec3<f32>, direction: vec3<f32>, point: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let slope = dot(direction, unit_normal);
    let height = dot(point - at, unit_normal);
    if height * slope <= 0.0 || abs(slope) < 1e-18 {
        return 0.0;
    }
    let distance = quotient(abs(height), abs(slope));
    return area_density(distance * direction, unit_normal, area);
}
