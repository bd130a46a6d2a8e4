// All instances' triangles under one tree, in world space.
// use shared/triangle

const HAS_INSTANCES: bool = false;

/// Number of the first triangle of each instance; instances follow each other.
@group(0) @binding(3) var<storage, read> first_triangles: array<u32>;

/// Takes the ray to the tree; its root, or an empty word for no ray.
fn enter_outer(ray: Ray) -> u32 {
    let root = enter_bvh(0u, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), 0u);
    prepare_triangles(greatest(ray.origin) + bvhs[0].row_x.w);
    return root;
}

fn enter_inner(ray: Ray, word: u32) -> u32 {
    return EMPTY;
}

/// A hit with the scene's numbers: the last instance that starts at or before the triangle.
fn placed(hit: Hit) -> Hit {
    var low = 0u;
    var high = arrayLength(&first_triangles);
    // The instance is in low..high.
    loop {
        if high - low <= 1u {
            break;
        }
        let middle = (low + high) >> 1u;
        if first_triangles[middle] <= hit.primitive {
            low = middle;
        } else {
            high = middle;
        }
    }
    return Hit(hit.t, hit.u, hit.v, hit.primitive - first_triangles[low], low);
}
