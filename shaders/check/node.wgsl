// The box test of one node, without the traversal around it, to measure its accuracy and cost.
//
// Each ray tests one BVH that consists of a single node; ray indices wrap around the BVHs.
// use shared/invocation/index
// use shared/bvh/node

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// Key of the box that each ray enters first.
@group(1) @binding(1) var<storage, read_write> entries: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) {
        return;
    }
    let ray = rays[index];
    // BVH 0 is the top level, which is empty here.
    let bvh = 1u + index % (arrayLength(&bvhs) - 1u);
    let root = enter_bvh(bvh, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), 0u);
    var first = vec4<u32>(MISSED);
    if root != EMPTY {
        let farthest = scaled_t(ray.t_max);
        first = min(enter(root, 0u, farthest), enter(root, 1u, farthest));
    }
    entries[index] = min(min(first.x, first.y), min(first.z, first.w));
}
