// The first hit of each ray.
// use shared/trace
// use shared/groups

/// Rays as hits: a miss, or a walk that was cut short, is told by the instance.
@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = invocation(group, groups, 64u, local);
    if index >= arrayLength(&rays) {
        return;
    }
    var hit = closest_hit(rays[index]);
    if is_incomplete {
        hit.instance = INCOMPLETE;
    }
    hits[index] = hit;
}
