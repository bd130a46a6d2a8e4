// Direct light, diffuse bounces, ambient light with occlusion: one sample of one pixel an invocation, a cell of 8 x 8 pixels a
// work-group. The twin of the CPU's hybrid integrator, whose documentation says what is gathered and with which bias.
//
// `?direct` and `?shape_lights` are the lights of the list, `?sky` what is behind everything, `?film` keeps what was found, `?time` says when
// rays fly; `?mask`, of tracing, is alpha.
//
// All rays of a path, shadow rays too, are traced at one place of the text: compilers copy functions to where they are called,
// and traversal is by far the greatest.
// use shared/camera
// use shared/picture
// use shared/ray_key
// use shared/sampling
// use shared/surface
// use shared/trace
// use ?shape_lights
// use ?direct
// use ?film
// use ?sky
// use ?time

/// Dimension of the first bounce.
const FIRST_BOUNCE: u32 = 1u;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let group = group_id.y * groups.x + group_id.x;
    let one = taken(group, local);
    if one.is_inside {
        choose_time(one);
        let start = camera_ray(one);
        let light = gathered(one, start.ray, start.cone);
        keep(group, local, light.radiance, light.n_rays);
    }
}

struct Light {
    radiance: vec3<f32>,
    /// Rays traced for it.
    n_rays: u32,
}

/// Light that arrives against a camera ray.
fn gathered(one: PixelSample, camera: Ray, camera_cone: Cone) -> Light {
    let path_key = derived_key(0u, bits(picture.sampler, one.pixel, one.sample, PASSAGE));
    var light = Light(vec3(0.0), 0u);
    var throughput = vec3(1.0);
    var ray = camera;
    var cone = camera_cone;
    var surface: Surface;
    // Vertices before the ray's end.
    var vertex = 0u;
    var vertex_key = path_key;
    ray_key = derived_key(path_key, 0u);
    // Where the ray is one to a light: what it brings, and the lights asked so far.
    var asked = NOT_ASKED;
    var n_asked = 0u;
    loop {
        light.n_rays += 1u;
        let hit = traverse(ray, asked.is_asked);
        if asked.is_asked {
            if hit.instance == NONE {
                light.radiance += throughput * asked.radiance;
            }
        } else {
            let end = end_of(ray, hit, vertex);
            light.radiance += throughput * end.radiance;
            if end.ends {
                break;
            }
            surface = surface_at(hit, ray.direction, cone);
            light.radiance += throughput * surface.emission;
            vertex_key = derived_key(path_key, 1u + vertex);
            n_asked = 0u;
        }
        asked = ask(one, vertex, surface, vertex_key, n_asked);
        n_asked = asked.n_asked;
        ray = asked.ray;
        light.radiance += throughput * asked.free;
        if !asked.is_asked {
            // Leave along a cosine-sampled direction, whose weight is the albedo.
            throughput *= surface.base_color;
            let local = cosine_hemisphere(square(one, FIRST_BOUNCE + vertex));
            ray = spawn_ray(surface, mirror_outward(surface, basis_about(surface.shading_normal) * local));
            cone = scattered(surface.cone, cosine_density(local.z));
            ray_key = vertex_key;
            vertex += 1u;
        }
    }
    return light;
}

/// What a ray that leaves the camera or a surface brings by itself, and whether the path ends there.
struct End {
    ends: bool,
    radiance: vec3<f32>,
}

/// The end of a ray behind `n_vertices` of its path: a body, what is behind everything, or ambient light at the last.
fn end_of(ray: Ray, hit: Hit, n_vertices: u32) -> End {
    let is_miss = hit.instance == NONE;
    let met = intersect_shape_lights(Ray(ray.origin, ray.t_min, ray.direction, select(hit.t, ray.t_max, is_miss)));
    if met.is_hit {
        // Behind a surface the shadow ray to it has brought its light.
        return End(true, select(vec3(0.0), met.radiance, n_vertices == 0u));
    }
    if is_miss {
        return End(true, sky_radiance(ray.direction));
    }
    if n_vertices > picture.bounces {
        return End(true, picture.ambient * unoccluded(hit.t * length(ray.direction)));
    }
    return End(false, vec3(0.0));
}

/// Share of the ambient light that comes through beside an occluder: 0 at contact, near 1 beyond the radius.
fn unoccluded(distance: f32) -> f32 {
    let x = min(distance * picture.inverse_ao_radius, 100.0);
    // For small x the series, which keeps its digits: what it lacks is below x^5/120.
    if x < 0.0625 {
        return x * (1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0))));
    }
    return 1.0 - exp(-x);
}
