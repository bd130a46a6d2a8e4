// part instance
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

// choice single
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

// choice flat
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

// choice instances
// A tree a mesh, and a tree over the instances.
//
// # What the transform adds
// The CPU takes a ray to object space in f64 and rounds once. Here each component is three products of the inverse's rows,
// rounded from f64, with the direction, and with the origin from where the instance stands. With E = 2^-23 a component of the
// direction is off by half an E for its row, 3 E for products and sums, half an E for the CPU's own, of the sum of absolute
// products; 5 E are more. The origin has one E more for the difference. A sheared coordinate of a triangle within M differs
// by twice the origin's, and by twice the direction's over its greatest component for each unit of M.
// use shared/level/instance

/// Takes the ray to the instance that a leaf of the outer tree names; the root of its tree.
fn enter_inner(ray: Ray, word: u32) -> u32 {
    let instance = instance_order[word & LEAF_FIRST];
    let entry = instances[instance];
    let away = ray.origin - vec3<f32>(entry.row_x.w, entry.row_y.w, entry.row_z.w);
    return enter_instance(ray, instance, still_inverse(entry), away, abs(away), vec2<f32>(ORIGIN_ROUNDING, DIRECTION_ROUNDING));
}

// choice moving
// A tree a mesh, and a tree over the instances, of which some move while the shutter is open.
//
// # What the transform adds
// Of what stands still, what shared/level/instances says. A row of a moving instance's inverse is cofactors over the determinant, off by
// 4.5 E and 7.5 E (shared/motion), by 2.5 E for the quotient and E for the product: 15.5 E of the sum of absolute terms, `sizes`. With
// 3 E for products and sums and half an E for the CPU's own a direction is off by 19 E; 20 E leave room for second order, and for
// rows and motions rounded on the CPU in f64. The origin has E more for the difference, and its place is off by 2 E of its own terms,
// for which an eighth of them is added to what 21 E are taken of.
// use shared/motion
// use shared/level/instance

const MOVING_DIRECTION_ROUNDING: f32 = 20.0 * ROUNDING;
const MOVING_ORIGIN_ROUNDING: f32 = 21.0 * ROUNDING;

/// Takes the ray to the instance that a leaf of the outer tree names; the root of its tree.
fn enter_inner(ray: Ray, word: u32) -> u32 {
    let instance = instance_order[word & LEAF_FIRST];
    let entry = instances[instance];
    let open = vec3<f32>(entry.row_x.w, entry.row_y.w, entry.row_z.w);
    var inverse = still_inverse(entry);
    var away = ray.origin - open;
    var far_away = abs(away);
    var roundings = vec2<f32>(ORIGIN_ROUNDING, DIRECTION_ROUNDING);
    if entry.tree.y != 0u {
        let motion = entry.tree.y - 1u;
        inverse = moving_inverse(motion);
        away = ray.origin - between(open, motions[motion].shift);
        far_away = abs(away) + 0.125 * between(abs(open), abs(motions[motion].shift));
        roundings = vec2<f32>(MOVING_ORIGIN_ROUNDING, MOVING_DIRECTION_ROUNDING);
    }
    return enter_instance(ray, instance, inverse, away, far_away, roundings);
}

/// The inverse on the way.
fn moving_inverse(motion: u32) -> Inverse {
    let weights = weights_of_time();
    // Above 2^-34, by what hosts refuse.
    let share = reciprocal(determinant_of(motion));
    var inverse: Inverse;
    for (var k = 0u; k < 3u; k++) {
        let row = motions[motion].cofactors[k];
        inverse.rows[k] = share * (row * weights);
        inverse.sizes[k] = share * (mat3x3<f32>(abs(row[0]), abs(row[1]), abs(row[2])) * weights);
    }
    return inverse;
}
