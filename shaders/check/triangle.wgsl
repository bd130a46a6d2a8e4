// The test of one triangle, as leaves of every walk make it: what it errs by and takes, with no walk around it.
//
// Each ray has a tree of its own that is one leaf; rays that are more than the trees begin with the first again.
// use shared/groups
// use shared/node
// use shared/leaf

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
    let ray = rays[index];
    // The first tree is that over instances, of which there are none.
    let tree = 1u + index % (arrayLength(&bvhs) - 1u);
    let root = enter_bvh(tree, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), 0u);
    prepare_triangles(greatest(ray.origin) + bvhs[tree].row_x.w);
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    t_max = scaled_t(ray.t_max);
    if root != EMPTY {
        leaf(root);
    }
    hits[index] = best;
}
