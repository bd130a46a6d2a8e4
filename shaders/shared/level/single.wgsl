// One instance under one tree, in world space.
// use shared/triangle

const HAS_INSTANCES: bool = false;

/// Takes the ray to the tree; its root, or an empty word for no ray.
fn enter_outer(ray: Ray) -> u32 {
    let root = enter_bvh(0u, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), 0u);
    prepare_triangles(greatest(ray.origin) + bvhs[0].row_x.w);
    return root;
}

fn enter_inner(ray: Ray, word: u32) -> u32 {
    return EMPTY;
}

/// A hit with the scene's numbers.
fn placed(hit: Hit) -> Hit {
    return hit;
}
