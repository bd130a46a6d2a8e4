// Starts paths at the camera. Each invocation takes one sample of one pixel, in the same order as render/path.
// use shared/invocation/index
// use alternatives/wavefront/paths
// use alternatives/wavefront/paths/queue
// use ?time

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    if one.is_inside {
        choose_time(one);
        paths[64u * group + id.local] = path_from(camera_ray(one));
    }
    enqueue(one.is_inside, 64u * group + id.local, id.local);
}
