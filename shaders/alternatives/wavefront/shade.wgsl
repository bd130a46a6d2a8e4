// Takes each path on by what its ray met, and closes up those that go on.
//
// `?film` keeps what the others found.
// use shared/groups
// use alternatives/wavefront/paths
// use alternatives/wavefront/queue
// use ?film
// use ?time

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = invocation(group, groups, 64u, local);
    var place = 0u;
    var goes_on = false;
    if index < n_active[0] {
        place = active_paths[index];
        let one = taken(place / 64u, place % 64u);
        choose_time(one);
        let hit = hits[index];
        var path = paths[place];
        ray_key = key_of(path, one);
        is_incomplete = hit.instance == INCOMPLETE;
        if !is_incomplete {
            advance(&path, one, hit);
        }
        goes_on = path.stage != DONE && !is_incomplete;
        if goes_on {
            paths[place] = path;
        } else {
            keep(place / 64u, place % 64u, path.radiance, path.n_rays);
        }
    }
    enqueue(goes_on, place, local);
}
