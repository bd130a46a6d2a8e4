// Paths begin at the camera: one sample of one pixel an invocation, as render/path takes them.
// use alternatives/wavefront/paths
// use alternatives/wavefront/queue
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
        paths[64u * group + local] = path_from(camera_ray(one));
    }
    enqueue(one.is_inside, 64u * group + local, local);
}
