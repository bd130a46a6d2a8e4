// The test of one triangle, without the traversal around it, to measure its accuracy and cost.
//
// Each ray tests one BVH that consists of a single leaf; ray indices wrap around the BVHs.
// use shared/invocation/index
// use shared/bvh/node
// use shared/triangle/leaf/records

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) {
        return;
    }
    let ray = rays[index];
    world_ray = ray;
    // BVH 0 is the top level, which is empty here.
    let bvh = 1u + index % (arrayLength(&bvhs) - 1u);
    let root = enter_bvh(bvh, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), NONE);
    prepare_triangles(greatest(ray.origin) + bvhs[bvh].row_x.w);
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    t_max = scaled_t(ray.t_max);
    if root != EMPTY {
        triangle_leaf(root);
    }
    hits[index] = best;
}
