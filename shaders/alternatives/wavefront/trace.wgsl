// What the rays of paths meet: one ray an invocation.
// use shared/groups
// use alternatives/wavefront/paths
// use shared/trace
// use ?time

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = invocation(group, groups, 64u, local);
    if index < n_active[0] {
        let place = active_paths[index];
        let one = taken(place / 64u, place % 64u);
        choose_time(one);
        ray_key = key_of(paths[place], one);
        hits[index] = traverse(paths[place].ray, paths[place].stage == TO_LIGHT);
        if is_incomplete {
            hits[index].instance = INCOMPLETE;
        }
    }
}
