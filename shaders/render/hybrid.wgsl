// Hybrid integrator: one sample of one pixel per invocation.
//
// `?components` is what is kept of the light in parts, `?first_light` what of that at the first surface, `?mask` which hits count,
// `?time` the time of rays, `?first` what is known of the first hits.
//
// All rays of a sample share one call site. Compilers inline functions at each call, and traversal is by far the largest.
// use shared/invocation/index
// use shared/hybrid
// use shared/facing/scattered
// use shared/ray
// use ?traverse
// use shared/camera/film
// use ?components
// use ?first_light
// use ?mask
// use ?time
// use ?first

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    var radiance = vec3(0.0);
    var n_rays = 0u;
    if one.is_inside {
        choose_time(one);
        start_components(64u * group + id.local);
        start_first_light(64u * group + id.local);
        var state = gathering_from(camera_ray(one));
        // How far the camera ray is traced.
        var reach = first_reach(state.ray, one.pixel);
        // The hidden face at which the scattered ray that is traced again ends.
        var hidden = miss();
        ray_sample = one.sample;
        loop {
            ray_key = key_of(state, one);
            let is_from_camera = state.n_rays == 1u;
            let is_scattered = state.stage == ONWARD && state.n_vertices > 0u;
            let is_arriving = state.stage == TO_LIGHT || hidden.instance != NONE;
            face_ray(state.ray.direction, is_scattered, is_arriving);
            let t_max = select(state.ray.t_max, reach, is_from_camera);
            var hit = traverse(Ray(state.ray.origin, state.ray.t_min, state.ray.direction, t_max), is_arriving);
            if is_from_camera && hit.instance == NONE && reach < state.ray.t_max {
                reach = state.ray.t_max;
                continue;
            }
            if is_traced_again(&hit, &hidden, is_scattered) {
                state.n_rays += 1u;
                continue;
            }
            advance(&state, one, hit);
            if state.stage == DONE || is_incomplete {
                break;
            }
        }
        radiance = state.radiance;
        n_rays = state.n_rays;
        if is_dropped(radiance) {
            clear_components();
            clear_first_light();
        }
    }
    keep(group, id.local, one, radiance, n_rays);
}
