// Traces one ray of a path per invocation.
// use shared/invocation/index
// use alternatives/wavefront/paths
// use ?traverse
// use ?time

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index < n_active[0] {
        let path_index = active_paths[index];
        let one = taken(path_index / 64u, path_index % 64u);
        choose_time(one);
        ray_key = key_of(paths[path_index], one);
        hits[index] = traverse(paths[path_index].ray, paths[path_index].stage == TO_LIGHT);
        if is_incomplete {
            hits[index].instance = INCOMPLETE;
        }
    }
}
