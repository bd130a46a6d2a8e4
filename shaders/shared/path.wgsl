// One step of a path; twin of crates/renderer/src/integrate/path.rs, which describes the estimator and its weights.
//
// A vertex scatters before its shadow ray is traced. So while a ray is traced, of the surface only the data for multiple
// importance sampling is kept.
//
// `?shape_lights` and `?sky` are what rays may hit besides triangles, `?components` is what is kept of light in parts.
// use shared/camera
// use shared/picture
// use shared/hash/ray_key
// use shared/facing
// use shared/surface/vertex
// use shared/light/sampler
// use ?shape_lights
// use ?sky
// use ?components

/// Throughput from which a path always survives roulette.
const SURVIVAL_THROUGHPUT: f32 = 0.5;

/// Minimum probability of termination by roulette, and number of vertices before it applies.
const MIN_TERMINATION: f32 = 0.05;
const MIN_TERMINATION_FROM: u32 = 4u;

/// Sampler dimensions at each vertex, after the position in the pixel.
const LIGHT: u32 = 0u;
const LIGHT_CHOICE: u32 = 1u;
const SCATTERING: u32 = 2u;
const SCATTERING_CHOICE: u32 = 3u;
const ROULETTE: u32 = 4u;
const N_DIMENSIONS: u32 = 5u;

/// What a path is waiting for: the next ray, a shadow ray, or nothing.
const ONWARD: u32 = 0u;
const TO_LIGHT: u32 = 1u;
const DONE: u32 = 2u;

/// State of a path.
struct Path {
    /// The ray that is traced now.
    ray: Ray,
    radiance: vec3<f32>,
    /// `ONWARD`, `TO_LIGHT` or `DONE`.
    stage: u32,
    /// Factor of the light from the next vertex.
    throughput: vec3<f32>,
    /// Radiance factor of refraction contained in the throughput; it cancels when the path leaves the body.
    compression: f32,
    /// Contribution of the shadow ray if it is unoccluded.
    pending: vec3<f32>,
    /// Number of vertices so far.
    n_vertices: u32,
    /// The ray after the shadow ray; its direction is zero if the path ends.
    onward_origin: vec3<f32>,
    /// Density of the onward direction; negative if no light was sampled for it.
    density: f32,
    onward_direction: vec3<f32>,
    n_rays: u32,
    /// The receiver at the vertex that the onward ray leaves.
    position: vec3<f32>,
    transmits: u32,
    normal: vec3<f32>,
    /// Cone of the onward ray.
    cone_width: f32,
    shading_normal: vec3<f32>,
    cone_spread: f32,
    cone_scale: f32,
    cone_is_direct: u32,
    /// Surfaces that scattered the path. Mirrors and clear glass in front of the first one do not count.
    n_scattered: u32,
}

/// A path that starts at the camera.
fn path_from(start: CameraRay) -> Path {
    var path: Path;
    path.ray = start.ray;
    path.throughput = vec3(1.0);
    path.compression = 1.0;
    path.density = -1.0;
    path.n_rays = 1u;
    set_cone(&path, start.cone);
    return path;
}

/// Key of the ray that is traced now, derived from the vertex that it leaves.
fn key_of(path: Path, one: PixelSample) -> u32 {
    let all = derived_key(0u, bits(picture.sampler, one.pixel, 0u, ALPHA_DIMENSION));
    let onward = derived_key(all, path.n_vertices);
    return select(onward, derived_key(onward, 0u), path.stage == TO_LIGHT);
}

/// Advances a path by the hit of its ray.
fn advance(path: ptr<function, Path>, one: PixelSample, hit: Hit) {
    if (*path).stage == TO_LIGHT {
        add_light(path, select(vec3(0.0), (*path).pending, hit.instance == NONE));
        continue_onward(path);
        return;
    }
    let ray = (*path).ray;
    if ends(path, hit) {
        (*path).stage = DONE;
        return;
    }
    let number = (*path).n_vertices;
    let surface = surface_at(hit, ray, cone_of(*path));
    if any(surface.emission != vec3(0.0)) {
        let density = surface_light_density(previous_receiver(*path), hit.instance, hit.primitive, ray.direction);
        gather(path, surface.emission, density);
    }
    let vertex = vertex_of(surface);
    let receiver = Receiver(surface.position, is_transmitting(vertex.bsdf), vertex.normal, surface.shading_normal);
    (*path).n_vertices += 1u;
    let has_shadow_ray = !is_delta_only(vertex.bsdf) && sample_direct(path, one, surface, vertex, receiver, number);
    if !scatter(path, one, surface, vertex, number) {
        (*path).onward_direction = vec3(0.0);
    }
    (*path).position = receiver.position;
    (*path).transmits = u32(receiver.transmits);
    (*path).normal = receiver.normal;
    (*path).shading_normal = receiver.shading_normal;
    if has_shadow_ray {
        (*path).stage = TO_LIGHT;
    } else {
        continue_onward(path);
    }
}

/// Continues along the onward ray, if there is one.
fn continue_onward(path: ptr<function, Path>) {
    let direction = (*path).onward_direction;
    (*path).ray = infinite_ray((*path).onward_origin, direction);
    (*path).stage = select(ONWARD, DONE, all(direction == vec3(0.0)));
}

/// Whether the onward ray hits no surface to continue from; adds the light it hits.
fn ends(path: ptr<function, Path>, hit: Hit) -> bool {
    let ray = (*path).ray;
    let is_miss = hit.instance == NONE;
    let light_hit = intersect_shape_lights(Ray(ray.origin, ray.t_min, ray.direction, select(hit.t, ray.t_max, is_miss)));
    if light_hit.is_hit {
        gather(path, light_hit.radiance, shape_light_density(previous_receiver(*path), light_hit.number, ray.direction));
        return true;
    }
    if is_miss {
        let sees_background = (*path).n_vertices == 0u && picture.has_background != 0u;
        let radiance = select(sky_radiance(ray.direction), picture.background, sees_background);
        gather(path, radiance, sky_light_density(previous_receiver(*path), ray.direction));
        return true;
    }
    return (*path).n_vertices > picture.bounces;
}

/// Adds light that the onward ray hit, weighted by the density with which light sampling finds its direction.
fn gather(path: ptr<function, Path>, radiance: vec3<f32>, density: f32) {
    let weight = select(power_heuristic((*path).density, density), 1.0, (*path).density < 0.0);
    add_light(path, limited((*path).throughput * radiance * weight, (*path).n_scattered));
}

/// Adds light that all vertices so far scattered.
fn add_light(path: ptr<function, Path>, light: vec3<f32>) {
    (*path).radiance += light;
    add_component((*path).n_vertices, light);
}

/// The vertex that the onward ray left.
fn previous_receiver(path: Path) -> Receiver {
    return Receiver(path.position, path.transmits != 0u, path.normal, path.shading_normal);
}

/// Samples light for a vertex. Adds light that needs no shadow ray and returns false, or stores the shadow ray and returns
/// true.
fn sample_direct(
    path: ptr<function, Path>,
    one: PixelSample,
    surface: Surface,
    vertex: Vertex,
    receiver: Receiver,
    number: u32,
) -> bool {
    let choice = single(picture.sampler, one.pixel, one.sample, dimension(LIGHT_CHOICE, number));
    let light = sample_light(receiver, choice, square(one, dimension(LIGHT, number)));
    // At the last bounce, surface emission belongs to the vertex there.
    if light.incoming.shadow_ray == NO_LIGHT || (light.is_emission && number == picture.bounces) {
        return false;
    }
    let found = evaluate(vertex, light.incoming.to_light);
    if all(found.value == vec3(0.0)) {
        return false;
    }
    // No other technique samples a light without extent.
    let density = light.incoming.density;
    let weight = select(power_heuristic(density, found.density), 1.0, density == 0.0);
    let unlimited = (*path).throughput * (found.value * light.incoming.radiance) * weight;
    let contribution = limited(unlimited, (*path).n_scattered + 1u);
    let is_near = light.incoming.shadow_ray == FINITE;
    let ray = towards(surface, select(light.incoming.to_light, light.incoming.position, is_near), is_near);
    if ray.t_max <= 0.0 {
        add_light(path, contribution);
        return false;
    }
    (*path).n_rays += 1u;
    (*path).pending = contribution;
    (*path).ray = ray;
    return !shape_light_occludes(ray, light.shape_light);
}

/// Samples the onward ray and updates the throughput; false if there is none.
fn scatter(path: ptr<function, Path>, one: PixelSample, surface: Surface, vertex: Vertex, number: u32) -> bool {
    if !survives(path, one, number) {
        return false;
    }
    let choice = single(picture.sampler, one.pixel, one.sample, dimension(SCATTERING_CHOICE, number));
    let found = sample_bsdf(vertex.bsdf, vertex.outgoing, square(one, dimension(SCATTERING, number)), choice);
    if !found.is_found {
        return false;
    }
    let direction = world_direction(vertex, found.incident);
    (*path).throughput *= found.weight;
    (*path).n_scattered += select(0u, 1u, (*path).n_scattered > 0u || !found.is_delta);
    if found.is_transmitted {
        (*path).compression *= compression_of(vertex.bsdf);
    }
    if all((*path).throughput <= vec3(0.0)) {
        return false;
    }
    var density = found.density;
    if vertex.is_perturbed && !found.is_delta {
        // Both densities that lead to this direction, including that of the mirrored one.
        density = evaluate(vertex, direction).density;
    }
    (*path).density = select(density, -1.0, found.is_delta);
    if found.is_delta {
        set_cone(path, surface.cone);
    } else {
        set_cone(path, scattered(surface.cone, density));
    }
    let ray = spawn_ray(surface, direction);
    (*path).onward_origin = ray.origin;
    (*path).onward_direction = ray.direction;
    (*path).n_rays += 1u;
    return true;
}

/// Russian roulette: ends the path or increases its throughput, without bias.
fn survives(path: ptr<function, Path>, one: PixelSample, number: u32) -> bool {
    let throughput = (*path).throughput;
    let scale = quotient(max(throughput.x, max(throughput.y, throughput.z)), (*path).compression);
    let survival = min(scale / SURVIVAL_THROUGHPUT, select(1.0 - MIN_TERMINATION, 1.0, number < MIN_TERMINATION_FROM));
    if survival < 1.0 && single(picture.sampler, one.pixel, one.sample, dimension(ROULETTE, number)) >= survival {
        return false;
    }
    (*path).throughput /= survival;
    return true;
}

/// Weight of a sample against another technique: power heuristic with exponent 2.
fn power_heuristic(density: f32, other: f32) -> f32 {
    let ratio = quotient(other, max(density, 0.0));
    return 1.0 / (1.0 + ratio * ratio);
}

fn dimension(purpose: u32, number: u32) -> u32 {
    return 1u + number * N_DIMENSIONS + purpose;
}

fn set_cone(path: ptr<function, Path>, cone: Cone) {
    (*path).cone_width = cone.width;
    (*path).cone_spread = cone.spread;
    (*path).cone_scale = cone.scale;
    (*path).cone_is_direct = u32(cone.is_direct);
}

fn cone_of(path: Path) -> Cone {
    return Cone(path.cone_width, path.cone_spread, path.cone_scale, path.cone_is_direct != 0u);
}
