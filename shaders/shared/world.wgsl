// All vertices are in world space.
// use shared/picture

fn point_world(instance: u32, point: vec3<f32>) -> vec3<f32> {
    return point;
}

fn vector_world(instance: u32, vector: vec3<f32>) -> vec3<f32> {
    return vector;
}

/// The unit normal of the image of a plane; zero for zero.
fn normal_world(instance: u32, normal: vec3<f32>) -> vec3<f32> {
    return unit(normal);
}

fn area_root(instance: u32, triangle: Triangle) -> f32 {
    return triangle.area_root;
}

/// Whether the instance mirrors and its vertices do not show it.
fn mirrors(instance: u32) -> bool {
    return false;
}

/// Error along each axis between the plane of a triangle and a ray that leaves it.
fn slack_of(instance: u32) -> f32 {
    return picture.slack;
}
