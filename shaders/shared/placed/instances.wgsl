// Instances of meshes that stand still.
// use shared/placement

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
