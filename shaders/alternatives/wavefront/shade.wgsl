// Advances each path by the hit of its ray and compacts the paths that continue.
// use shared/invocation/index
// use alternatives/wavefront/paths
// use alternatives/wavefront/paths/queue
// use shared/film/samples
// use ?time

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    var path_index = 0u;
    var is_active = false;
    if index < n_active[0] {
        path_index = active_paths[index];
        let one = taken(path_index / 64u, path_index % 64u);
        choose_time(one);
        let hit = hits[index];
        var path = paths[path_index];
        ray_key = key_of(path, one);
        is_incomplete = hit.instance == INCOMPLETE;
        if !is_incomplete {
            advance(&path, one, hit);
        }
        is_active = path.stage != DONE && !is_incomplete;
        if is_active {
            paths[path_index] = path;
        } else {
            keep(path_index / 64u, path_index % 64u, one, path.radiance, path.n_rays);
        }
    }
    enqueue(is_active, path_index, id.local);
}
