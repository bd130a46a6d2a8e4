// Path tracer: one sample of one pixel per invocation.
//
// `?film` is what is kept of samples, `?time` the time of rays. All rays of a path, including shadow rays, share one call site, and so does all shading.
// Compilers inline functions at each call.
// use shared/invocation/index
// use shared/path
// use ?traverse
// use ?film
// use ?time

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    var radiance = vec3(0.0);
    var n_rays = 0u;
    if one.is_inside {
        choose_time(one);
        var path = path_from(camera_ray(one));
        loop {
            ray_key = key_of(path, one);
            let hit = traverse(path.ray, path.stage == TO_LIGHT);
            advance(&path, one, hit);
            if path.stage == DONE || is_incomplete {
                break;
            }
        }
        radiance = path.radiance;
        n_rays = path.n_rays;
    }
    keep(group, id.local, one, radiance, n_rays);
}
