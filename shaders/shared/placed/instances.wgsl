// Instances of meshes in object space.

struct Placement {
    /// Columns of the linear part, each with a number beside it: the error along each axis between the plane of a triangle and
    /// a ray that leaves it, -1 where the transform mirrors, and the number of the mesh's first triangle as bits.
    x: vec3<f32>,
    slack: f32,
    y: vec3<f32>,
    handedness: f32,
    z: vec3<f32>,
    first_triangle: u32,
    shift: vec3<f32>,
    /// Greatest length to which the cofactors take a unit normal, as a root: areas grow by its square.
    scale_root: f32,
    /// Columns of the cofactor matrix over the square of `scale_root`, so that they stay in range.
    cofactor_x: vec3<f32>,
    cofactor_y: vec3<f32>,
    cofactor_z: vec3<f32>,
}

@group(2) @binding(3) var<storage, read> placements: array<Placement>;

fn triangle_of(hit: Hit) -> u32 {
    return placements[hit.instance].first_triangle + hit.primitive;
}

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    return vector_world(instance, point) + placements[instance].shift;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    return placements[instance].x * vector.x + placements[instance].y * vector.y + placements[instance].z * vector.z;
}

/// The unit normal of the image of a plane, on the side to which cofactors take it; zero for zero.
fn normal_world(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return unit(by_cofactors(instance, normal));
}

fn by_cofactors(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return placements[instance].cofactor_x * normal.x + placements[instance].cofactor_y * normal.y
        + placements[instance].cofactor_z * normal.z;
}

fn area_root(instance: u32, triangle: Triangle) -> f32 {
    return triangle.area_root * placements[instance].scale_root * sqrt(size(by_cofactors(instance, triangle.normal)));
}

/// Whether the instance mirrors.
fn mirrors(instance: u32) -> bool {
    return placements[instance].handedness < 0.0;
}

/// Error along each axis between the plane of a triangle and a ray that leaves it.
fn slack_of(instance: u32) -> f32 {
    return placements[instance].slack;
}
