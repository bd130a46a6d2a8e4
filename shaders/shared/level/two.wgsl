// A tree a mesh, and a tree over the instances.
//
// # What the transform adds
// The CPU takes a ray to object space in f64 and rounds once. Here each component is three products of the inverse's rows,
// rounded from f64, with the direction, and with the origin from where the instance stands. With E = 2^-23 a component of the
// direction is off by half an E for its row, 3 E for products and sums, half an E for the CPU's own, of the sum of absolute
// products; 5 E are more. The origin has one E more for the difference. A sheared coordinate of a triangle within M differs
// by twice the origin's, and by twice the direction's over its greatest component for each unit of M.
// use shared/triangle

const HAS_INSTANCES: bool = true;

/// Roundings of a direction in object space, and of an origin.
const DIRECTION_ROUNDING: f32 = 5.0 * ROUNDING;
const ORIGIN_ROUNDING: f32 = 6.0 * ROUNDING;

/// An instance: rows of the linear part of `object_from_world`, each with a component of where the object's origin stands in
/// the world, and its tree.
struct Place {
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    tree: vec4<u32>,
}

@group(0) @binding(3) var<storage, read> places: array<Place>;
/// Instances in the order of the outer tree's leaves.
@group(0) @binding(4) var<storage, read> instances: array<u32>;

/// Takes the ray to the outer tree; its root, or an empty word for no ray.
fn enter_outer(ray: Ray) -> u32 {
    return enter_tree(0u, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), NONE);
}

/// Takes the ray to the instance that a leaf of the outer tree names; the root of its tree.
fn enter_inner(ray: Ray, word: u32) -> u32 {
    let instance = instances[word & LEAF_FIRST];
    let place = places[instance];
    let away = ray.origin - vec3<f32>(place.row_x.w, place.row_y.w, place.row_z.w);
    let origin = object(place, away);
    let direction = object(place, ray.direction);
    let drift = 2.0 * vec2<f32>(ORIGIN_ROUNDING * spread(place, away), DIRECTION_ROUNDING * spread(place, ray.direction));
    let root = enter_tree(place.tree.x, origin, direction, ray.t_min, drift, instance);
    prepare_triangles(greatest(origin) + trees[place.tree.x].row_x.w);
    return root;
}

/// A vector in object space.
fn object(place: Place, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(project(place.row_x.xyz, v), project(place.row_y.xyz, v), project(place.row_z.xyz, v));
}

/// The greatest sum of absolute products of any component.
fn spread(place: Place, v: vec3<f32>) -> f32 {
    let size = abs(v);
    let x = project(abs(place.row_x.xyz), size);
    let y = project(abs(place.row_y.xyz), size);
    return max(x, max(y, project(abs(place.row_z.xyz), size)));
}

/// A hit with the scene's numbers.
fn placed(hit: Hit) -> Hit {
    return hit;
}
