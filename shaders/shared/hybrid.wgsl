// One step of a sample of the hybrid integrator: direct light, diffuse bounces, ambient occlusion. Twin of the CPU's, whose documentation describes the
// estimate and its bias.
//
// `?direct` and `?shape_lights` are the listed lights, `?sky` the background, `?hemisphere` how diffuse directions are sampled, `?components` what is kept of
// light in parts, `?first_light` what of that at the first surface.
//
// The onward ray of a surface is known before its last shadow ray is traced, so that both can be traced at the same time.
// use shared/camera
// use shared/picture
// use shared/hash/ray_key
// use shared/facing
// use shared/sampling
// use shared/surface
// use ?hemisphere
// use ?shape_lights
// use ?direct
// use ?components
// use ?first_light
// use ?sky

/// Sampler dimension of the first bounce.
const FIRST_BOUNCE: u32 = 1u;

/// Surfaces from which light is indirect.
const INDIRECT: u32 = 2u;

/// What a sample is waiting for: the next ray, a shadow ray, or nothing.
const ONWARD: u32 = 0u;
const TO_LIGHT: u32 = 1u;
const DONE: u32 = 2u;

/// State of a sample.
struct Gathering {
    /// The ray that is traced now.
    ray: Ray,
    radiance: vec3<f32>,
    /// `ONWARD`, `TO_LIGHT` or `DONE`.
    stage: u32,
    /// Factor of the light from the next vertex.
    throughput: vec3<f32>,
    n_rays: u32,
    /// Contribution of the shadow ray if it is unoccluded, and the vertex that sends it.
    pending: vec3<f32>,
    pending_vertex: u32,
    /// The ray after the shadow ray; its direction is zero while there are more lights.
    onward_origin: vec3<f32>,
    /// Vertices before the end of the onward ray.
    n_vertices: u32,
    onward_direction: vec3<f32>,
    /// Lights visited at the vertex.
    n_visited: u32,
    /// The surface at the vertex.
    position: vec3<f32>,
    offset: f32,
    normal: vec3<f32>,
    cone_width: f32,
    shading_normal: vec3<f32>,
    cone_spread: f32,
    smooth_position: vec3<f32>,
    cone_scale: f32,
    smooth_normal: vec3<f32>,
    cone_is_direct: u32,
    base_color: vec3<f32>,
}

/// A sample that starts at the camera.
fn gathering_from(start: CameraRay) -> Gathering {
    var state: Gathering;
    state.ray = start.ray;
    state.throughput = vec3(1.0);
    state.n_rays = 1u;
    set_cone(&state, start.cone);
    return state;
}

/// Key of the ray that is traced now, derived from the vertex that it leaves.
fn key_of(state: Gathering, one: PixelSample) -> u32 {
    let all = derived_key(0u, bits(picture.sampler, one.pixel, 0u, ALPHA_DIMENSION));
    let shadow = derived_key(derived_key(all, 1u + state.pending_vertex), state.n_visited - 1u);
    return select(derived_key(all, state.n_vertices), shadow, state.stage == TO_LIGHT);
}

/// Advances a sample by the hit of its ray.
fn advance(state: ptr<function, Gathering>, one: PixelSample, hit: Hit) {
    if (*state).stage == TO_LIGHT {
        add_pending(state, hit.instance == NONE);
        if any((*state).onward_direction != vec3(0.0)) {
            continue_onward(state);
        } else {
            visit_lights(state, one);
        }
        return;
    }
    let ray = (*state).ray;
    let vertex = (*state).n_vertices;
    let end = end_of(ray, hit, vertex);
    if KEEPS_FIRST_LIGHT && vertex == 1u {
        // At the last bounce, the mean stands in for the environment of a direction that is occluded.
        let is_mean = end.is_surface && end.ends;
        let unoccluded = (*state).throughput * select(sky_radiance(ray.direction), picture.ambient, is_mean);
        keep_ambient(unoccluded, (*state).throughput * select(vec3(0.0), end.radiance, end.ends));
    }
    let at_end = limited((*state).throughput * end.radiance, vertex);
    (*state).radiance += at_end;
    // The ambient term stands for light of further bounces.
    add_component(select(vertex, INDIRECT, hit.instance != NONE && vertex > picture.bounces), at_end);
    if end.ends {
        (*state).stage = DONE;
        return;
    }
    let surface = surface_at(hit, ray, cone_of(*state));
    let emitted = limited((*state).throughput * surface.emission, vertex);
    (*state).radiance += emitted;
    add_component(vertex, emitted);
    (*state).position = surface.position;
    (*state).offset = surface.offset;
    (*state).normal = surface.normal;
    (*state).shading_normal = surface.shading_normal;
    (*state).smooth_position = surface.smooth_surface.position;
    (*state).smooth_normal = surface.smooth_surface.normal;
    (*state).base_color = surface.base_color;
    set_cone(state, surface.cone);
    (*state).n_visited = 0u;
    visit_lights(state, one);
}

/// Adds the light of the shadow ray, if it arrives.
fn add_pending(state: ptr<function, Gathering>, arrives: bool) {
    if arrives {
        // Shadow rays find no rare bright light, so none is limited.
        (*state).radiance += (*state).pending;
        add_component((*state).pending_vertex + 1u, (*state).pending);
        add_arriving((*state).pending_vertex, (*state).pending);
    }
}

/// Sends the shadow ray to the next light; after the last one, or with its shadow ray, the onward ray.
fn visit_lights(state: ptr<function, Gathering>, one: PixelSample) {
    let vertex = (*state).n_vertices;
    let throughput = (*state).throughput;
    let surface = surface_of_state(*state);
    let shadow = next_shadow_ray(one, vertex, surface, (*state).n_visited);
    (*state).n_visited = shadow.n_visited;
    (*state).radiance += throughput * shadow.unshadowed;
    add_component(vertex + 1u, throughput * shadow.unshadowed);
    // In the order in which light arrives, so that both sums are the same where all arrives.
    add_arriving(vertex, throughput * shadow.unshadowed);
    add_diffuse(vertex, throughput * shadow.unshadowed);
    add_diffuse(vertex, throughput * shadow.radiance);
    add_diffuse(vertex, throughput * shadow.hidden);
    if shadow.exists {
        (*state).n_rays += 1u;
        (*state).pending = throughput * shadow.radiance;
        (*state).pending_vertex = vertex;
        (*state).ray = shadow.ray;
        (*state).stage = TO_LIGHT;
        (*state).onward_direction = vec3(0.0);
        if shadow.n_visited == n_listed_lights() {
            scatter(state, one, surface);
        }
        return;
    }
    scatter(state, one, surface);
    continue_onward(state);
}

/// Samples the onward ray: a cosine-sampled direction, whose weight is the albedo.
fn scatter(state: ptr<function, Gathering>, one: PixelSample, surface: Surface) {
    let local = hemisphere_direction(square(one, FIRST_BOUNCE + (*state).n_vertices));
    (*state).throughput *= surface.base_color * hemisphere_weight(local.z);
    let ray = spawn_ray(surface, mirror_outward(surface, basis_about(surface.shading_normal) * local));
    set_cone(state, scattered(surface.cone, hemisphere_density(local.z)));
    (*state).onward_origin = ray.origin;
    (*state).onward_direction = ray.direction;
    (*state).n_vertices += 1u;
    (*state).n_rays += 1u;
}

/// Continues along the onward ray.
fn continue_onward(state: ptr<function, Gathering>) {
    (*state).ray = infinite_ray((*state).onward_origin, (*state).onward_direction);
    (*state).stage = ONWARD;
}

/// What lights and the onward ray need of the surface at the vertex.
fn surface_of_state(state: Gathering) -> Surface {
    var surface: Surface;
    surface.position = state.position;
    surface.offset = state.offset;
    surface.normal = state.normal;
    surface.shading_normal = state.shading_normal;
    surface.smooth_surface = SmoothSurface(state.smooth_position, state.smooth_normal);
    surface.base_color = state.base_color;
    surface.cone = cone_of(state);
    return surface;
}

fn set_cone(state: ptr<function, Gathering>, cone: Cone) {
    (*state).cone_width = cone.width;
    (*state).cone_spread = cone.spread;
    (*state).cone_scale = cone.scale;
    (*state).cone_is_direct = u32(cone.is_direct);
}

fn cone_of(state: Gathering) -> Cone {
    return Cone(state.cone_width, state.cone_spread, state.cone_scale, state.cone_is_direct != 0u);
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
