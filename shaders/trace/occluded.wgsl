// Whether each ray hits anything.
// use shared/trace
// use shared/groups

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// 1 where anything is hit, 0 where nothing is, INCOMPLETE where the walk was cut short and has found nothing.
@group(1) @binding(1) var<storage, read_write> found: array<u32>;

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
    let is_hit = occluded(rays[index]);
    found[index] = select(select(0u, INCOMPLETE, is_incomplete), 1u, is_hit);
}
