// Light of the list on its way to a point, if nothing stands between; twin of crates/renderer/src/light/incoming.rs.
//
// All in f32: what is found has a relative error of some units in the last place of the greatest coordinate over the
// distance, as its input has. Near a ball the cone's height changes with the square root of the distance to it, so
// does its error.
// use shared/numbers
// use shared/angle
// use shared/sampling
// use shared/light/list

/// Nothing arrives.
const NO_LIGHT: u32 = 0u;
/// A shadow ray ends at `place`.
const FINITE: u32 = 1u;
/// A shadow ray goes along `to_light` without end.
const INFINITE: u32 = 2u;

/// Light that would arrive at a point.
struct IncomingLight {
    /// Unit vector.
    to_light: vec3<f32>,
    /// With which `to_light` was found, per steradian; 0 for a light without extent.
    density: f32,
    /// Radiance over density; of a light without extent the irradiance on what faces it.
    radiance: vec3<f32>,
    /// `NO_LIGHT`, `FINITE` or `INFINITE`.
    reach: u32,
    /// The point of the light, where it is near.
    place: vec3<f32>,
}

fn no_incoming_light() -> IncomingLight {
    return IncomingLight(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), NO_LIGHT, vec3(0.0));
}

/// What comes from a light of the list to a point; `square` is used by lights that have an extent.
fn incoming_light(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    switch light.kind {
        case SUN: { return IncomingLight(-light.direction, 0.0, bounded(light.color), INFINITE, vec3(0.0)); }
        case SPHERE: { return incoming_from_sphere(light, at, square); }
        case DISK: { return incoming_from_disk(light, at, square); }
        default: { return incoming_from_point(light, at); }
    }
}

fn incoming_from_point(light: ListLight, at: vec3<f32>) -> IncomingLight {
    let way = light.place - at;
    let distance_squared = dot(way, way);
    if distance_squared < LEAST_SQUARE {
        return no_incoming_light();
    }
    let to_light = way / sqrt(distance_squared);
    var share = 1.0;
    if light.kind == SPOT {
        share = spot_share(-dot(light.direction, to_light), light.extent, light.cos_outer);
    }
    let factor = quotient(share, distance_squared);
    if factor <= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(to_light, 0.0, bounded(light.color * factor), FINITE, light.place);
}

/// Share of a spot's intensity at a cosine to its axis; a cone without a soft edge is cut.
fn spot_share(cosine: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cosine >= cos_inner {
        return 1.0;
    }
    if cosine <= cos_outer {
        return 0.0;
    }
    let share = (cosine - cos_outer) / (cos_inner - cos_outer);
    return share * share;
}

/// One minus the cosine of half the angle in which a point sees a ball at a distance; 0 from inside.
fn cap_height(radius: f32, distance: f32) -> f32 {
    if distance <= radius {
        return 0.0;
    }
    let sine = radius / distance;
    // As products, so that near and far points lose no digits.
    let cosine = sqrt((1.0 - sine) * (1.0 + sine));
    return sine * sine / (1.0 + cosine);
}

/// A direction into the cone in which the point sees the ball, uniform over the solid angle.
fn incoming_from_sphere(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    let way = light.place - at;
    let distance = length(way);
    let height = cap_height(light.extent, distance);
    if height <= 0.0 {
        return no_incoming_light();
    }
    let below = square.x * height;
    let cosine = 1.0 - below;
    let sine_squared = below * (2.0 - below);
    // Half the chord that the ball cuts from the direction; none at the rim, where rounding may pass zero.
    let sine = sqrt(sine_squared);
    let across = distance * sine;
    let half_chord = sqrt(max((light.extent - across) * (light.extent + across), 0.0));
    let to_light = basis_about(way / distance) * vec3(sine * circle(square.y), cosine);
    let place = at + to_light * (distance * cosine - half_chord);
    let solid_angle = TAU * height;
    return IncomingLight(to_light, quotient(1.0, solid_angle), bounded(light.color * solid_angle), FINITE, place);
}

/// Density of `incoming_from_sphere` in all directions that meet the ball; 0 from inside.
fn sphere_density(light: ListLight, at: vec3<f32>) -> f32 {
    let height = cap_height(light.extent, length(light.place - at));
    return select(0.0, quotient(1.0, TAU * height), height > 0.0);
}

/// A uniform point of a disc; nothing from behind, where it is dark.
fn incoming_from_disk(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    let place = light.place + basis_about(light.direction) * vec3(light.extent * uniform_disk(square), 0.0);
    let way = place - at;
    let density = area_density(way, light.direction, PI * light.extent * light.extent);
    if density <= 0.0 || dot(way, light.direction) >= 0.0 {
        return no_incoming_light();
    }
    return IncomingLight(normalize(way), density, bounded(light.color * quotient(1.0, density)), FINITE, place);
}

/// Density of `incoming_from_disk` in a unit direction that meets the disc; 0 from behind.
fn disk_density(light: ListLight, at: vec3<f32>, direction: vec3<f32>) -> f32 {
    if dot(direction, light.direction) >= 0.0 {
        return 0.0;
    }
    return plane_density(at, direction, light.place, light.direction, PI * light.extent * light.extent);
}

/// Density per steradian of a uniform point of a plane figure, from the way to it; 0 where it is seen edge-on.
fn area_density(way: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let distance_squared = dot(way, way);
    let height = abs(dot(way, unit_normal));
    // dA * cos = r^2 * dw, and r * cos is the height over the plane.
    if distance_squared < LEAST_SQUARE || height < 1e-18 * sqrt(distance_squared) {
        return 0.0;
    }
    let stretch = min(sqrt(distance_squared) / height, GREATEST);
    return min(quotient(distance_squared, area) * stretch, GREATEST);
}

/// The same at the point where a unit direction meets the plane; 0 where it does not.
fn plane_density(at: vec3<f32>, direction: vec3<f32>, point: vec3<f32>, unit_normal: vec3<f32>, area: f32) -> f32 {
    let slope = dot(direction, unit_normal);
    let height = dot(point - at, unit_normal);
    if height * slope <= 0.0 || abs(slope) < 1e-18 {
        return 0.0;
    }
    let distance = quotient(abs(height), abs(slope));
    return area_density(distance * direction, unit_normal, area);
}
