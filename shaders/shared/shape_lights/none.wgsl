// No light has a body.

/// Whether a body but the light `except` stands along a ray.
fn shape_light_occludes(ray: Ray, except: u32) -> bool {
    return false;
}

/// The light of the nearest body along a ray before `t_max`.
struct ShapeLightHit {
    is_hit: bool,
    number: u32,
    radiance: vec3<f32>,
    t: f32,
}

fn intersect_shape_lights(ray: Ray) -> ShapeLightHit {
    return ShapeLightHit(false, 0u, vec3(0.0), ray.t_max);
}

/// Unit normal of a body at a point of it.
fn shape_light_normal(number: u32, point: vec3<f32>) -> vec3<f32> {
    return vec3(0.0);
}
