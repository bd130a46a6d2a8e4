// Light along paths: one sample of one pixel an invocation, a cell of 8 x 8 pixels a work-group.
//
// `?film` keeps what was found, `?time` says when it flies. All rays of a path, those to lights too, are traced at one place of the text, and all that happens
// between two rays is at one: compilers copy functions to where they are called.
// use shared/path
// use shared/trace
// use ?film
// use ?time

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
        var path = path_from(camera_ray(one));
        loop {
            ray_key = key_of(path, one);
            let hit = traverse(path.ray, path.stage == TO_LIGHT);
            advance(&path, one, hit);
            if path.stage == DONE || is_incomplete {
                break;
            }
        }
        keep(group, local, path.radiance, path.n_rays);
    }
}
