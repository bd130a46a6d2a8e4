// Normals that vertices say.
// const NORMAL

/// The unit normal between those of the vertices, on their side; zero where they say none.
fn smooth_normal(seen: Seen) -> vec3<f32> {
    if NORMAL == 0u {
        return vec3(0.0);
    }
    return normal_world(seen.instance, blend_three(seen.vertices, seen.weights, NORMAL));
}

/// A vertices' normal on the side of the viewer; the triangle's `normal` where it shows the viewer its back.
fn shown_smooth(blended: vec3<f32>, seen: Seen, normal: vec3<f32>) -> vec3<f32> {
    let facing = select(blended, -blended, dot(blended, normal) < 0.0);
    return select(normal, facing, dot(facing, seen.direction) < 0.0);
}
