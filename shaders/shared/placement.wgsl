// Instances of meshes in object space, as they stand or, of those that move, as the shutter opens.

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
    /// Root of what cofactors are divided by to stay in range: areas grow by its square.
    scale_root: f32,
    /// Columns of the cofactor matrix, divided so.
    cofactor_x: vec3<f32>,
    /// Number of the motion, `NONE` of what stands still.
    motion: u32,
    cofactor_y: vec3<f32>,
    cofactor_z: vec3<f32>,
}

@group(2) @binding(3) var<storage, read> placements: array<Placement>;

fn triangle_of(hit: Hit) -> u32 {
    return placements[hit.instance].first_triangle + hit.primitive;
}

/// The unit normal of the image of a plane, on the side to which cofactors take it; zero for zero.
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
