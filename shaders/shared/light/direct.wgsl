// Shadow rays to the listed lights.

/// A shadow ray and its contribution.
struct ShadowRay {
    /// Whether there is such a ray.
    exists: bool,
    /// Reflected radiance if the ray is unoccluded.
    radiance: vec3<f32>,
    ray: Ray,
    /// Number of lights visited so far.
    n_visited: u32,
    /// Reflected radiance from lights too close for an occluder in between.
    unshadowed: vec3<f32>,
    /// Reflected radiance from lights that shape lights occlude, as if they did not.
    hidden: vec3<f32>,
}

const NO_RAY: Ray = Ray(vec3<f32>(), 0.0, vec3<f32>(), 0.0);
const NO_SHADOW_RAY: ShadowRay = ShadowRay(false, vec3<f32>(), NO_RAY, 0u, vec3<f32>(), vec3<f32>());

// choice list
// One shadow ray for each listed light. A Lambertian surface of reflectance r reflects r/pi of its irradiance in every
// direction.
// use shared/light/list/lights
// use shared/light/list
// use shared/invocation/iterations

/// First sampler dimension of lights, beyond all bounces; one for each vertex and light.
const FIRST_LIGHT: u32 = 65536u;

/// The shadow ray to the next light after the first `n_visited` that may reach the surface on the viewer's side, above the
/// horizons of both the surface and the shading normal. Its key is derived from `vertex_key` by the index of the light.
fn next_shadow_ray(one: PixelSample, vertex: u32, surface: Surface, vertex_key: u32, n_visited: u32) -> ShadowRay {
    let n_lights = arrayLength(&lights);
    var shadow = NO_SHADOW_RAY;
    for (var number = n_visited; number < n_lights && !shadow.exists; number++) {
        iterations += 1u;
        shadow.n_visited = number + 1u;
        let dimension = FIRST_LIGHT + vertex * n_lights + number;
        let incoming = incoming_light(lights[number], surface.position, square(one, dimension));
        let cosine = dot(surface.shading_normal, incoming.to_light);
        if incoming.shadow_ray == NO_LIGHT || cosine <= 0.0 || dot(surface.smooth_surface.normal, incoming.to_light) <= 0.0 {
            continue;
        }
        let reflected = surface.base_color * (incoming.radiance * (cosine / PI));
        let is_near = incoming.shadow_ray == FINITE;
        let ray = towards(surface, select(incoming.to_light, incoming.position, is_near), is_near);
        if ray.t_max <= 0.0 {
            shadow.unshadowed += reflected;
        } else if shape_light_occludes(ray, number) {
            shadow.hidden += reflected;
        } else {
            shadow.exists = true;
            shadow.radiance = reflected;
            shadow.ray = ray;
            ray_key = derived_key(vertex_key, number);
        }
    }
    return shadow;
}

// choice none
// No listed lights.

fn next_shadow_ray(one: PixelSample, vertex: u32, surface: Surface, vertex_key: u32, n_visited: u32) -> ShadowRay {
    return NO_SHADOW_RAY;
}
