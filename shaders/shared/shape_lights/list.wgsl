// Balls and discs of the list as rays meet them: they stand in the light of others and are black where they do not shine.
// use shared/light/lights
// use shared/numbers
// use shared/iterations

/// Whether a body but the light `except` stands along a ray.
fn shape_light_occludes(ray: Ray, except: u32) -> bool {
    iterations += arrayLength(&lights);
    for (var number = 0u; number < arrayLength(&lights); number++) {
        if number != except && shape_light_crossing(lights[number], ray).t <= ray.t_max {
            return true;
        }
    }
    return false;
}

/// The light of the nearest body along a ray; of equals the one that comes first in the list.
struct ShapeLightHit {
    is_hit: bool,
    /// Of the list.
    number: u32,
    radiance: vec3<f32>,
    t: f32,
}

fn intersect_shape_lights(ray: Ray) -> ShapeLightHit {
    iterations += arrayLength(&lights);
    var met = ShapeLightHit(false, 0u, vec3(0.0), ray.t_max);
    for (var number = 0u; number < arrayLength(&lights); number++) {
        let crossing = shape_light_crossing(lights[number], ray);
        if crossing.t < met.t || (crossing.t == met.t && !met.is_hit) {
            met = ShapeLightHit(true, number, select(vec3(0.0), lights[number].color, crossing.shines), crossing.t);
        }
    }
    return met;
}

/// Unit normal of a body at a point of it.
fn shape_light_normal(number: u32, point: vec3<f32>) -> vec3<f32> {
    if lights[number].kind == DISK {
        return lights[number].direction;
    }
    return normalize(point - lights[number].place);
}

/// Where a ray meets a body first, and whether on the side that shines.
struct Crossing {
    /// Beyond `FAR` where it does not.
    t: f32,
    shines: bool,
}

const NO_CROSSING: f32 = 3.2e38;

fn shape_light_crossing(light: ListLight, ray: Ray) -> Crossing {
    switch light.kind {
        case SPHERE: { return sphere_crossing(light, ray); }
        case DISK: { return disk_crossing(light, ray); }
        default: { return Crossing(NO_CROSSING, false); }
    }
}

/// The discriminant comes from the vector from the centre to the line, at right angles to it, so small and far balls lose few
/// digits (Haines et al. 2019).
fn sphere_crossing(light: ListLight, ray: Ray) -> Crossing {
    let from_center = ray.origin - light.place;
    let d_squared = dot(ray.direction, ray.direction);
    let closest = -dot(from_center, ray.direction) / max(d_squared, LEAST_SQUARE);
    let distance = length(from_center + closest * ray.direction);
    let chord_squared = (light.extent - distance) * (light.extent + distance);
    if chord_squared < 0.0 || d_squared < LEAST_SQUARE {
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

/// Rim included; rays in its plane pass by.
fn disk_crossing(light: ListLight, ray: Ray) -> Crossing {
    let slope = dot(ray.direction, light.direction);
    let height = dot(light.place - ray.origin, light.direction);
    // As quotients of absolute values, which stay in range.
    let t = quotient(abs(height), abs(slope)) * sign_of(height) * sign_of(slope);
    // A ray almost in the plane crosses it so far off that a long direction would leave the range: there is no disc.
    let way = abs(light.place - ray.origin);
    let length = abs(ray.direction);
    let farthest = 2.0 * (max(way.x, max(way.y, way.z)) + light.extent);
    let is_near = abs(t) <= quotient(farthest, max(length.x, max(length.y, length.z)));
    let from_center = (ray.origin + select(0.0, t, is_near) * ray.direction) - light.place;
    let is_inside = is_near && dot(from_center, from_center) <= light.extent * light.extent;
    let is_within = slope != 0.0 && ray.t_min <= t && t <= ray.t_max;
    return Crossing(select(NO_CROSSING, t, is_inside && is_within), slope < 0.0);
}
