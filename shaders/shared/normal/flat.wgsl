// Every mesh is flat: the triangle's normal is what is shaded with.

fn shading_normal(material: u32, seen: Seen, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return normal;
}
