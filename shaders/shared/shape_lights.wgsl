// choice none
// No sphere or disk lights.

/// Whether a shape light other than `except` occludes a ray.
fn shape_light_occludes(ray: Ray, except: u32) -> bool {
    return false;
}

/// Closest shape light along a ray, up to `t_max`.
struct ShapeLightHit {
    is_hit: bool,
    number: u32,
    radiance: vec3<f32>,
    t: f32,
}

fn intersect_shape_lights(ray: Ray) -> ShapeLightHit {
    return ShapeLightHit(false, 0u, vec3(0.0), ray.t_max);
}

/// Unit normal of a shape light at one of its points.
fn shape_light_normal(number: u32, point: vec3<f32>) -> vec3<f32> {
    return vec3(0.0);
}

// choice list
// Sphere and disk lights as rays hit them. They occlude each other, and sides that do not emit are black.
// use shared/light/list/lights
// use shared/numbers
// use shared/invocation/iterations

/// Whether a shape light other than `except` occludes a ray.
fn shape_light_occludes(ray: Ray, except: u32) -> bool {
    iterations += arrayLength(&lights);
    for (var number = 0u; number < arrayLength(&lights); number++) {
        if number != except && shape_light_crossing(lights[number], ray).t <= ray.t_max {
            return true;
        }
    }
    return false;
}

/// Closest shape light along a ray; ties go to the first of the list.
struct ShapeLightHit {
    is_hit: bool,
    /// Index in the list.
    number: u32,
    radiance: vec3<f32>,
    t: f32,
}

fn intersect_shape_lights(ray: Ray) -> ShapeLightHit {
    iterations += arrayLength(&lights);
    var light_hit = ShapeLightHit(false, 0u, vec3(0.0), ray.t_max);
    for (var number = 0u; number < arrayLength(&lights); number++) {
        let crossing = shape_light_crossing(lights[number], ray);
        if crossing.t < light_hit.t || (crossing.t == light_hit.t && !light_hit.is_hit) {
            light_hit = ShapeLightHit(true, number, select(vec3(0.0), lights[number].color, crossing.emits), crossing.t);
        }
    }
    return light_hit;
}

/// Unit normal of a shape light at one of its points.
fn shape_light_normal(number: u32, point: vec3<f32>) -> vec3<f32> {
    if lights[number].kind == DISK {
        return lights[number].direction;
    }
    return normalize(point - lights[number].position);
}

/// Closest intersection with a shape light, and whether its side emits.
struct Crossing {
    /// Above `FAR` for a miss.
    t: f32,
    emits: bool,
}

const NO_CROSSING: f32 = 3.2e38;

fn shape_light_crossing(light: ListLight, ray: Ray) -> Crossing {
    switch light.kind {
        case SPHERE: { return sphere_crossing(light, ray); }
        case DISK: { return disk_crossing(light, ray); }
        default: { return Crossing(NO_CROSSING, false); }
    }
}

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

/// Includes the edge; rays in the plane of the disk miss.
fn disk_crossing(light: ListLight, ray: Ray) -> Crossing {
    let slope = dot(ray.direction, light.direction);
    let height = dot(light.position - ray.origin, light.direction);
    // As quotients of absolute values, which stay in range.
    let t = quotient(abs(height), abs(slope)) * sign_of(height) * sign_of(slope);
    // A nearly parallel ray would reach the plane so far away that a long direction overflows; it misses the disk anyway.
    let delta = abs(light.position - ray.origin);
    let length = abs(ray.direction);
    let farthest = 2.0 * (max(delta.x, max(delta.y, delta.z)) + light.extent);
    let is_near = abs(t) <= quotient(farthest, max(length.x, max(length.y, length.z)));
    let from_center = (ray.origin + select(0.0, t, is_near) * ray.direction) - light.position;
    let is_inside = is_near && dot(from_center, from_center) <= light.extent * light.extent;
    let is_within = slope != 0.0 && ray.t_min <= t && t <= ray.t_max;
    return Crossing(select(NO_CROSSING, t, is_inside && is_within), slope < 0.0);
}
