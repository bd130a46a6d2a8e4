// The test of one node's boxes, as every walk makes it: what enters and what it takes, with no walk around it.
//
// Each ray has a tree of its own that is one node; rays that are more than the trees begin with the first again.
// use shared/groups
// use shared/node

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// Keys of the boxes that rays enter first.
@group(1) @binding(1) var<storage, read_write> entries: array<u32>;

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
    let ray = rays[index];
    // The first tree is that over instances, of which there are none.
    let tree = 1u + index % (arrayLength(&bvhs) - 1u);
    let root = enter_bvh(tree, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), 0u);
    var first = vec4<u32>(MISSED);
    if root != EMPTY {
        let farthest = scaled_t(ray.t_max);
        first = min(enter(root, 0u, farthest), enter(root, 1u, farthest));
    }
    entries[index] = min(min(first.x, first.y), min(first.z, first.w));
}
