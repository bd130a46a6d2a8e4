// First hits of rays that fly at times of their own, to be compared with the CPU's.
// use shared/groups
// use shared/ray_time
// use shared/trace

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read> times: array<f32>;
@group(1) @binding(2) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = invocation(group, groups, 64u, local);
    if index < arrayLength(&rays) {
        ray_time = times[index];
        var hit = closest_hit(rays[index]);
        // As in trace/closest.
        if is_incomplete {
            hit.instance = INCOMPLETE;
        }
        hits[index] = hit;
    }
}
