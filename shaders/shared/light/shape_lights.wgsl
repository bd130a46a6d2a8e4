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
// The closest shape light along a ray. Shape lights occlude each other.
// use shared/light/list/lights
// use shared/light/list/hit
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
    return normal_of_light(lights[number], point);
}
