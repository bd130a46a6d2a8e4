// Path tracer: one sample of one pixel per invocation.
//
// `?components` is what is kept of the light in parts, `?mask` which hits count, `?time` the time of rays. All rays of a path, including shadow rays, share one call site, and so does all shading.
// Compilers inline functions at each call.
// use shared/invocation/index
// use shared/facing/scattered
// use shared/path
// use shared/ray
// use ?traverse
// use shared/camera/film
// use ?components
// use ?mask
// use ?time

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    var radiance = vec3(0.0);
    var n_rays = 0u;
    if one.is_inside {
        choose_time(one);
        start_components(64u * group + id.local);
        var path = path_from(camera_ray(one));
        // The hidden face at which the scattered ray that is traced again ends.
        var hidden = miss();
        loop {
            ray_key = key_of(path, one);
            ray_sample = one.sample;
            let is_scattered = path.stage == ONWARD && path.n_scattered > 0u;
            let is_arriving = path.stage == TO_LIGHT || hidden.instance != NONE;
            face_ray(path.ray.direction, is_scattered, is_arriving);
            var hit = traverse(path.ray, is_arriving);
            if is_traced_again(&hit, &hidden, is_scattered) {
                path.n_rays += 1u;
                continue;
            }
            advance(&path, one, hit);
            if path.stage == DONE || is_incomplete {
                break;
            }
        }
        radiance = path.radiance;
        n_rays = path.n_rays;
        if is_dropped(radiance) {
            clear_components();
        }
    }
    keep(group, id.local, one, radiance, n_rays);
}
