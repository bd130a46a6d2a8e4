// What is above the BVHs of meshes.

/// A normal in world space, of any length, and the largest error of each component.
struct PlacedNormal {
    normal: vec3<f32>,
    error: vec3<f32>,
}

// part instance
// Instances, and the transform of a ray into one.
// use shared/exact/triangle

/// Rows of the linear part of `object_from_world`. The fourth components are the world position of the object's origin.
struct Instance {
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    /// Index of the BVH; index of the motion plus one, or 0 for none; mask; whether the BVH is over curves.
    bvh: vec4<u32>,
    /// The CPU's rows, with translations, as f64: two quads for each, lower halves first.
    exact_rows: array<vec4<u32>, 6>,
}

@group(0) @binding(3) var<storage, read> instances: array<Instance>;
/// Instances in the order of the leaves of the top-level BVH.
@group(0) @binding(4) var<storage, read> instance_order: array<u32>;

const HAS_INSTANCES: bool = true;

/// Bits of a leaf word of the top-level BVH for its instance.
const LEAF_INDEX: u32 = 0x03ffffffu;

/// Rounding of a direction and of an origin in object space, for an instance that does not move; see shared/level/instances.
const DIRECTION_ROUNDING: f32 = 5.0 * ROUNDING;
const ORIGIN_ROUNDING: f32 = 6.0 * ROUNDING;

/// Rows of the linear part of `object_from_world`, and the sums of absolute terms that each entry was computed from.
struct Inverse {
    rows: mat3x3<f32>,
    sizes: mat3x3<f32>,
}

/// Transforms the ray into the top-level BVH. Returns its root, or `EMPTY` for a degenerate ray.
fn enter_top(ray: Ray) -> u32 {
    world_ray = ray;
    return enter_bvh(0u, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), NONE);
}

/// The CPU's ray in the current instance, or outside of instances; not known if the instance moves.
fn exact_ray() -> ExactRay {
    let ray = exact_ray_of(world_ray);
    if space.instance == NONE {
        return ray;
    }
    var exact: ExactRay;
    for (var k = 0u; k < 3u; k++) {
        let xy = instances[space.instance].exact_rows[2u * k];
        let zw = instances[space.instance].exact_rows[2u * k + 1u];
        let row = array<vec2<u32>, 3>(xy.xy, xy.zw, zw.xy);
        for (var j = 0u; j < 3u; j++) {
            let entry = from_f64(row[j]);
            exact.origin[k] = as_f64(added(exact.origin[k], as_f64(multiplied(entry, ray.origin[j]))));
            exact.direction[k] = as_f64(added(exact.direction[k], as_f64(multiplied(entry, ray.direction[j]))));
        }
        exact.origin[k] = as_f32(as_f64(added(exact.origin[k], from_f64(zw.zw))));
    }
    exact.is_known = instances[space.instance].bvh.y == 0u;
    return exact;
}

/// The inverse of an instance that does not move.
fn still_inverse(entry: Instance) -> Inverse {
    let rows = mat3x3<f32>(entry.row_x.xyz, entry.row_y.xyz, entry.row_z.xyz);
    return Inverse(rows, mat3x3<f32>(abs(rows[0]), abs(rows[1]), abs(rows[2])));
}

/// The instance of a leaf of the top-level BVH.
fn instance_of(word: u32) -> u32 {
    return instance_order[word & LEAF_INDEX];
}

/// Transforms the ray into the instance of a leaf of the top-level BVH. Returns the root of its BVH.
fn enter_instance_leaf(ray: Ray, word: u32) -> u32 {
    return enter_instance(ray, instance_of(word));
}

/// Transforms the ray by the inverse of an instance and returns the root of its BVH. The origin is at `away` from the origin of the
/// instance, a difference of numbers up to `far_away`. `roundings` are those of origin and direction.
fn enter_by_inverse(
    ray: Ray, instance: u32, inverse: Inverse, away: vec3<f32>, far_away: vec3<f32>, roundings: vec2<f32>
) -> u32 {
    let origin = by_rows(inverse.rows, away);
    let direction = by_rows(inverse.rows, ray.direction);
    let spread = vec2<f32>(greatest(by_rows(inverse.sizes, far_away)), greatest(by_rows(inverse.sizes, abs(ray.direction))));
    let bvh = instances[instance].bvh.x;
    let root = enter_bvh(bvh, origin, direction, ray.t_min, 2.0 * roundings * spread, instance);
    prepare_triangles(greatest(origin) + bvhs[bvh].row_x.w);
    return root;
}

fn by_rows(rows: mat3x3<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(project(rows[0], v), project(rows[1], v), project(rows[2], v));
}

/// A hit with the scene's indices.
fn placed(hit: Hit) -> Hit {
    return hit;
}

/// Rays whose masks have a bit of this one hit the instance.
fn mask_of(instance: u32) -> u32 {
    return instances[instance].bvh.z;
}

/// Number of the BVH of an instance.
fn bvh_of(instance: u32) -> u32 {
    return instances[instance].bvh.x;
}

/// Whether the current BVH is over curves.
fn is_of_curves() -> bool {
    return instances[space.instance].bvh.w != 0u;
}

/// The image of a normal: by the transposed inverse, whose rows are products and two sums. `rounding` is relative to the sum of absolute terms.
fn normal_by(inverse: Inverse, normal: vec3<f32>, rounding: f32) -> PlacedNormal {
    return PlacedNormal(inverse.rows * normal, rounding * (inverse.sizes * abs(normal)));
}

// part world
// BVHs in world space.
// use shared/exact/triangle

const HAS_INSTANCES: bool = false;

/// Transforms the ray into the BVH. Returns its root, or `EMPTY` for a degenerate ray.
fn enter_top(ray: Ray) -> u32 {
    world_ray = ray;
    let root = enter_bvh(0u, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), 0u);
    prepare_triangles(greatest(ray.origin) + bvhs[0].row_x.w);
    return root;
}

fn enter_instance_leaf(ray: Ray, word: u32) -> u32 {
    return EMPTY;
}

fn enter_instance(ray: Ray, instance: u32) -> u32 {
    return enter_top(ray);
}

/// The CPU's ray.
fn exact_ray() -> ExactRay {
    return exact_ray_of(world_ray);
}

fn instance_of(word: u32) -> u32 {
    return 0u;
}

fn mask_of(instance: u32) -> u32 {
    return 0xffffffffu;
}

fn bvh_of(instance: u32) -> u32 {
    return 0u;
}

/// Whether the BVH is over curves, in kernels that know of them.
fn is_of_curves() -> bool {
    return true;
}

/// A normal in world space, which is rounded to f32.
fn placed_normal(instance: u32, normal: vec3<f32>) -> PlacedNormal {
    return PlacedNormal(normal, ROUNDING * abs(normal));
}

// choice single
// A single instance in world space.
// use shared/level/world

/// A hit with the scene's indices.
fn placed(hit: Hit) -> Hit {
    return hit;
}

// choice flat
// The triangles of all instances in one BVH, in world space.
// use shared/level/world

/// First triangle of each instance, in increasing order.
@group(0) @binding(3) var<storage, read> first_triangles: array<u32>;

/// A hit with the scene's indices: the last instance that starts at or before the triangle.
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

// choice instances
// One BVH per mesh, and a top-level BVH over the instances.
//
// # Error of the transform
// The CPU transforms a ray to object space in f64 and rounds once. Here each component is a sum of three products of a row of
// the inverse, rounded from f64, with the direction or with the origin relative to the instance. With E = 2^-23, a component of
// the direction errs by E / 2 for its row, 3 E for products and sums and E / 2 for the CPU's rounding, relative to the sum of
// absolute products; 5 E is an upper bound. The origin adds E for the difference. A sheared coordinate of a triangle within M
// differs by twice the error of the origin, plus M times twice the error of the direction over its largest component.
// use shared/level/instance

/// Transforms the ray into an instance. Returns the root of its BVH.
fn enter_instance(ray: Ray, instance: u32) -> u32 {
    let entry = instances[instance];
    let away = ray.origin - vec3<f32>(entry.row_x.w, entry.row_y.w, entry.row_z.w);
    return enter_by_inverse(ray, instance, still_inverse(entry), away, abs(away), vec2<f32>(ORIGIN_ROUNDING, DIRECTION_ROUNDING));
}

/// A normal in world space. Rows and normal are rounded to f32: E / 2 each; with 3 E for products and sums, 4 E.
fn placed_normal(instance: u32, normal: vec3<f32>) -> PlacedNormal {
    return normal_by(still_inverse(instances[instance]), normal, 4.0 * ROUNDING);
}

// choice moving
// One BVH per mesh, and a top-level BVH over the instances, some of which move.
//
// # Error of the transform
// For instances that do not move, see shared/level/instances. A row of a moving instance's inverse is cofactors over the
// determinant, which err by 4.5 E and 7.5 E (shared/motion); the quotient adds 2.5 E and the product E: 15.5 E of the sum of
// absolute terms, `sizes`. With 3 E for products and sums and E / 2 for the CPU's rounding, a direction errs by 19 E; 20 E
// covers second-order terms and the rounding of rows and motions from f64. The origin adds E for the difference. Its position
// errs by 2 E of its own terms; an eighth of them is added to the value that is multiplied by 21 E.
// use shared/motion
// use shared/level/instance

const MOVING_DIRECTION_ROUNDING: f32 = 20.0 * ROUNDING;
const MOVING_ORIGIN_ROUNDING: f32 = 21.0 * ROUNDING;

/// Transforms the ray into an instance. Returns the root of its BVH.
fn enter_instance(ray: Ray, instance: u32) -> u32 {
    let entry = instances[instance];
    let open = vec3<f32>(entry.row_x.w, entry.row_y.w, entry.row_z.w);
    var inverse = still_inverse(entry);
    var away = ray.origin - open;
    var far_away = abs(away);
    var roundings = vec2<f32>(ORIGIN_ROUNDING, DIRECTION_ROUNDING);
    if entry.bvh.y != 0u {
        let motion = entry.bvh.y - 1u;
        inverse = moving_inverse(motion);
        away = ray.origin - between(open, motions[motion].shift);
        far_away = abs(away) + 0.125 * between(abs(open), abs(motions[motion].shift));
        roundings = vec2<f32>(MOVING_ORIGIN_ROUNDING, MOVING_DIRECTION_ROUNDING);
    }
    return enter_by_inverse(ray, instance, inverse, away, far_away, roundings);
}

/// The inverse at the time of the ray.
fn moving_inverse(motion: u32) -> Inverse {
    let weights = weights_of_time();
    // Above 2^-34, because the host rejects other motions.
    let inverse_determinant = reciprocal(determinant_of(motion));
    var inverse: Inverse;
    for (var k = 0u; k < 3u; k++) {
        let row = motions[motion].cofactors[k];
        inverse.rows[k] = inverse_determinant * (row * weights);
        inverse.sizes[k] = inverse_determinant * (mat3x3<f32>(abs(row[0]), abs(row[1]), abs(row[2])) * weights);
    }
    return inverse;
}

/// A normal in world space at the time of the ray. With the 15.5 E of a row: 19 E, and 20 E with second-order terms.
fn placed_normal(instance: u32, normal: vec3<f32>) -> PlacedNormal {
    let entry = instances[instance];
    if entry.bvh.y == 0u {
        return normal_by(still_inverse(entry), normal, 4.0 * ROUNDING);
    }
    return normal_by(moving_inverse(entry.bvh.y - 1u), normal, 20.0 * ROUNDING);
}
