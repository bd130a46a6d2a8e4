// Instances of meshes, of which some move while the shutter is open: where they are at the time of the ray.
// use shared/motion
// use shared/placement

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
        // Over a factor of the determinant's sign.
        let weights = weights_of_time() * placements[instance].handedness;
        x = motions[motion].cofactors[0] * weights;
        y = motions[motion].cofactors[1] * weights;
        z = motions[motion].cofactors[2] * weights;
    }
    return x * normal.x + y * normal.y + z * normal.z;
}

/// The number of an instance's motion, `NONE` of one that stands still.
fn motion_of(instance: u32) -> u32 {
    return placements[instance].motion;
}
