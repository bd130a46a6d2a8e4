// Instances of trees, and the way of a ray into one.
// use shared/triangle

/// An instance: rows of the linear part of `object_from_world`, each with a component of where the object's origin stands in
/// the world, and its tree.
struct Instance {
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    /// The tree, and one more than the number of the motion, 0 for none.
    tree: vec4<u32>,
}

@group(0) @binding(3) var<storage, read> instances: array<Instance>;
/// Instances in the order of the outer tree's leaves.
@group(0) @binding(4) var<storage, read> instance_order: array<u32>;

const HAS_INSTANCES: bool = true;

/// Roundings of a direction in object space, and of an origin, where the instance stands still: see shared/level/instances.
const DIRECTION_ROUNDING: f32 = 5.0 * ROUNDING;
const ORIGIN_ROUNDING: f32 = 6.0 * ROUNDING;

/// The linear part of `object_from_world`: rows, and for each number how great what was added for it is.
struct Inverse {
    rows: mat3x3<f32>,
    sizes: mat3x3<f32>,
}

/// Takes the ray to the outer tree; its root, or an empty word for no ray.
fn enter_outer(ray: Ray) -> u32 {
    return enter_bvh(0u, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), NONE);
}

/// The inverse of an instance that stands still.
fn still_inverse(entry: Instance) -> Inverse {
    let rows = mat3x3<f32>(entry.row_x.xyz, entry.row_y.xyz, entry.row_z.xyz);
    return Inverse(rows, mat3x3<f32>(abs(rows[0]), abs(rows[1]), abs(rows[2])));
}

/// Takes the ray to an instance's tree; the tree's root. Its origin is `away` from where the instance stands, a difference of
/// numbers as great as `far_away`; `roundings` are of the origin and of the direction.
fn enter_instance(
    ray: Ray, instance: u32, inverse: Inverse, away: vec3<f32>, far_away: vec3<f32>, roundings: vec2<f32>
) -> u32 {
    let origin = by_rows(inverse.rows, away);
    let direction = by_rows(inverse.rows, ray.direction);
    let spread = vec2<f32>(greatest(by_rows(inverse.sizes, far_away)), greatest(by_rows(inverse.sizes, abs(ray.direction))));
    let tree = instances[instance].tree.x;
    let root = enter_bvh(tree, origin, direction, ray.t_min, 2.0 * roundings * spread, instance);
    prepare_triangles(greatest(origin) + bvhs[tree].row_x.w);
    return root;
}

fn by_rows(rows: mat3x3<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(project(rows[0], v), project(rows[1], v), project(rows[2], v));
}

/// A hit with the scene's numbers.
fn placed(hit: Hit) -> Hit {
    return hit;
}
