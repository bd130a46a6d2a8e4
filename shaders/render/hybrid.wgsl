// Hybrid integrator: direct light, diffuse bounces, ambient occlusion. One sample of one pixel per invocation. Twin of the CPU's
// hybrid integrator, whose documentation describes the estimate and its bias.
//
// `?film` is what is kept of samples, `?components` what of their light in parts, `?first_light` what of that at the first surface, `?mask` which hits count, `?direct` and `?shape_lights` are the listed lights, `?sky` the background, `?time` the time of
// rays, `?hemisphere` how diffuse directions are sampled, `?first` what is known of the first hits.
//
// All rays of a path share one call site. Compilers inline functions at each call, and traversal is by far the largest.
// use shared/invocation/index
// use shared/camera
// use shared/picture
// use shared/hash/ray_key
// use shared/facing
// use shared/sampling
// use shared/surface
// use ?traverse
// use ?hemisphere
// use ?shape_lights
// use ?direct
// use ?film
// use ?components
// use ?first_light
// use ?mask
// use ?sky
// use ?time
// use ?first

/// Sampler dimension of the first bounce.
const FIRST_BOUNCE: u32 = 1u;

/// Surfaces from which light is indirect.
const INDIRECT: u32 = 2u;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    var light = Light(vec3(0.0), 0u);
    if one.is_inside {
        choose_time(one);
        let start = camera_ray(one);
        light = gathered(one, start.ray, start.cone);
    }
    keep(group, id.local, one, light.radiance, light.n_rays);
    keep_components(group, id.local, one, light.radiance);
    keep_first_light(group, id.local, one, light.radiance);
}

struct Light {
    radiance: vec3<f32>,
    /// Number of rays traced.
    n_rays: u32,
}

/// Radiance along a camera ray.
fn gathered(one: PixelSample, camera: Ray, camera_cone: Cone) -> Light {
    let path_key = derived_key(0u, bits(picture.sampler, one.pixel, 0u, ALPHA_DIMENSION));
    ray_sample = one.sample;
    var light = Light(vec3(0.0), 0u);
    var throughput = vec3(1.0);
    var ray = camera;
    ray.t_max = first_reach(camera, one.pixel);
    var cone = camera_cone;
    var surface: Surface;
    // Vertices before the end of the ray.
    var vertex = 0u;
    var vertex_key = path_key;
    ray_key = derived_key(path_key, 0u);
    // While a shadow ray is traced: its contribution, and the number of lights visited.
    var shadow = NO_SHADOW_RAY;
    var n_visited = 0u;
    // The hidden face at which the scattered ray that is traced again ends.
    var hidden = miss();
    loop {
        let is_scattered = !shadow.exists && vertex > 0u;
        let is_arriving = shadow.exists || hidden.instance != NONE;
        face_along(ray.direction, select(select(SEEN, SCATTERED, is_scattered), ARRIVING, is_arriving));
        var hit = traverse(ray, is_arriving);
        if hit.instance == NONE && light.n_rays == 0u && ray.t_max < camera.t_max {
            ray.t_max = camera.t_max;
            continue;
        }
        light.n_rays += 1u;
        if hidden.instance != NONE {
            // The ray leaves the scene, or ends at the hidden face.
            if hit.instance != NONE {
                hit = hidden;
            }
            hidden = miss();
        } else if is_scattered && hit.instance != NONE && is_hidden(hit) && !is_incomplete {
            hidden = hit;
            continue;
        }
        if shadow.exists {
            if hit.instance == NONE {
                // Shadow rays find no rare bright light, so none is limited.
                light.radiance += throughput * shadow.radiance;
                add_component(vertex + 1u, throughput * shadow.radiance);
                add_arriving(vertex, throughput * shadow.radiance);
            }
        } else {
            let end = end_of(ray, hit, vertex);
            if KEEPS_FIRST_LIGHT && vertex == 1u {
                // At the last bounce, the mean stands in for the environment of a direction that is occluded.
                let is_mean = end.is_surface && end.ends;
                let unoccluded = throughput * select(sky_radiance(ray.direction), picture.ambient, is_mean);
                keep_ambient(unoccluded, throughput * select(vec3(0.0), end.radiance, end.ends));
            }
            let at_end = limited(throughput * end.radiance, vertex);
            light.radiance += at_end;
            // The ambient term stands for light of further bounces.
            add_component(select(vertex, INDIRECT, hit.instance != NONE && vertex > picture.bounces), at_end);
            if end.ends {
                break;
            }
            surface = surface_at(hit, ray, cone);
            let emitted = limited(throughput * surface.emission, vertex);
            light.radiance += emitted;
            add_component(vertex, emitted);
            vertex_key = derived_key(path_key, 1u + vertex);
            n_visited = 0u;
        }
        shadow = next_shadow_ray(one, vertex, surface, vertex_key, n_visited);
        n_visited = shadow.n_visited;
        ray = shadow.ray;
        light.radiance += throughput * shadow.unshadowed;
        add_component(vertex + 1u, throughput * shadow.unshadowed);
        // In the order in which light arrives, so that both sums are the same where all arrives.
        add_arriving(vertex, throughput * shadow.unshadowed);
        add_diffuse(vertex, throughput * shadow.unshadowed);
        add_diffuse(vertex, throughput * shadow.radiance);
        add_diffuse(vertex, throughput * shadow.hidden);
        if !shadow.exists {
            // Continue in a cosine-sampled direction, whose weight is the albedo.
            let local = hemisphere_direction(square(one, FIRST_BOUNCE + vertex));
            throughput *= surface.base_color * hemisphere_weight(local.z);
            ray = spawn_ray(surface, mirror_outward(surface, basis_about(surface.shading_normal) * local));
            cone = scattered(surface.cone, hemisphere_density(local.z));
            ray_key = vertex_key;
            vertex += 1u;
        }
    }
    return light;
}

/// Radiance at the end of a ray, and whether the path ends there.
struct End {
    ends: bool,
    radiance: vec3<f32>,
    /// Whether the ray hits a surface before any light.
    is_surface: bool,
}

/// The end of a ray after `n_vertices` vertices: a shape light, the background, or ambient light at the last bounce.
fn end_of(ray: Ray, hit: Hit, n_vertices: u32) -> End {
    let is_miss = hit.instance == NONE;
    let light_hit = intersect_shape_lights(Ray(ray.origin, ray.t_min, ray.direction, select(hit.t, ray.t_max, is_miss)));
    if light_hit.is_hit {
        // Behind a surface, shadow rays have already added this light.
        return End(true, select(vec3(0.0), light_hit.radiance, n_vertices == 0u), false);
    }
    if is_miss {
        let sees_background = n_vertices == 0u && picture.has_background != 0u;
        return End(true, select(sky_radiance(ray.direction), picture.background, sees_background), false);
    }
    if n_vertices > picture.bounces {
        return End(true, picture.ambient * unoccluded(hit.t * length(ray.direction)), true);
    }
    return End(false, vec3(0.0), true);
}

/// Fraction of the ambient light that passes an occluder at this distance: 0 at contact, near 1 beyond the radius.
fn unoccluded(distance: f32) -> f32 {
    let x = min(distance * picture.inverse_ao_radius, 100.0);
    // The series keeps its precision for small x; the truncation error is below x^5/120.
    if x < 0.0625 {
        return x * (1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0))));
    }
    return 1.0 - exp(-x);
}
