// part world
// Vertices in world space.
// use shared/picture

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    return point;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    return vector;
}

/// Unit normal of the transformed plane; zero for zero.
fn normal_world(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return unit(normal);
}

fn area_root(instance: u32, triangle: Triangle) -> f32 {
    return triangle.area_root;
}

/// Whether the instance mirrors and its vertices are not yet mirrored.
fn mirrors(instance: u32) -> bool {
    return false;
}

/// Error along each axis between the plane of a triangle and a ray that leaves it.
fn slack_of(instance: u32) -> f32 {
    return picture.slack;
}

// part placement
// Instances of meshes in object space, at shutter opening.

struct Placement {
    /// Columns of the linear part. The interleaved fields are: the error along each axis between the plane of a triangle and a
    /// ray that leaves it; -1 if the transform mirrors; and the first triangle of the mesh.
    x: vec3<f32>,
    slack: f32,
    y: vec3<f32>,
    handedness: f32,
    z: vec3<f32>,
    first_triangle: u32,
    shift: vec3<f32>,
    /// Square root of the divisor that keeps cofactors in range; areas scale with its square.
    scale_root: f32,
    /// Columns of the cofactor matrix, divided by it.
    cofactor_x: vec3<f32>,
    /// Index of the motion; `NONE` if the instance does not move.
    motion: u32,
    cofactor_y: vec3<f32>,
    cofactor_z: vec3<f32>,
}

@group(2) @binding(3) var<storage, read> placements: array<Placement>;

fn triangle_of(hit: Hit) -> u32 {
    return placements[hit.instance].first_triangle + hit.primitive;
}

/// Unit normal of the transformed plane, on the side given by the cofactors; zero for zero.
fn normal_world(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return unit(by_cofactors(instance, normal));
}

/// Whether the instance mirrors.
fn mirrors(instance: u32) -> bool {
    return placements[instance].handedness < 0.0;
}

/// Error along each axis between the plane of a triangle and a ray that leaves it.
fn slack_of(instance: u32) -> f32 {
    return placements[instance].slack;
}

fn area_root(instance: u32, triangle: Triangle) -> f32 {
    return triangle.area_root * placements[instance].scale_root * sqrt(size(by_cofactors(instance, triangle.normal)));
}

// choice single
// A single instance.
// use shared/placed/world

fn triangle_of(hit: Hit) -> u32 {
    return hit.primitive;
}

// choice flat
// Instances in world space, numbered as in the BVH over all of them.
// use shared/placed/world

/// First triangle of each instance.
@group(2) @binding(3) var<storage, read> firsts: array<u32>;

fn triangle_of(hit: Hit) -> u32 {
    return firsts[hit.instance] + hit.primitive;
}

// choice instances
// Instances of meshes that do not move.
// use shared/placed/placement

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    return vector_world(instance, point) + placements[instance].shift;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    return placements[instance].x * vector.x + placements[instance].y * vector.y + placements[instance].z * vector.z;
}

fn by_cofactors(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return placements[instance].cofactor_x * normal.x + placements[instance].cofactor_y * normal.y
        + placements[instance].cofactor_z * normal.z;
}

// choice moving
// Instances of meshes, some of which move, at the time of the ray.
// use shared/motion
// use shared/placed/placement

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    let motion = motion_of(instance);
    var shift = placements[instance].shift;
    if motion != NONE {
        shift = between(shift, motions[motion].shift);
    }
    return vector_world(instance, point) + shift;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    var linear = mat3x3<f32>(placements[instance].x, placements[instance].y, placements[instance].z);
    let motion = motion_of(instance);
    if motion != NONE {
        linear[0] = between(linear[0], motions[motion].x);
        linear[1] = between(linear[1], motions[motion].y);
        linear[2] = between(linear[2], motions[motion].z);
    }
    return linear[0] * vector.x + linear[1] * vector.y + linear[2] * vector.z;
}

fn by_cofactors(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    var x = placements[instance].cofactor_x;
    var y = placements[instance].cofactor_y;
    var z = placements[instance].cofactor_z;
    let motion = motion_of(instance);
    if motion != NONE {
        // Divided by a factor with the determinant's sign.
        let weights = weights_of_time() * placements[instance].handedness;
        x = motions[motion].cofactors[0] * weights;
        y = motions[motion].cofactors[1] * weights;
        z = motions[motion].cofactors[2] * weights;
    }
    return x * normal.x + y * normal.y + z * normal.z;
}

/// Index of an instance's motion; `NONE` if it does not move.
fn motion_of(instance: u32) -> u32 {
    return placements[instance].motion;
}
