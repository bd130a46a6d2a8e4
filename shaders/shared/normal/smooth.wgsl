// Normals interpolated between vertices.
// use shared/vertex_normal

fn shading_normal(material: u32, seen: Seen, normal: vec3<f32>, is_mirrored: bool) -> vec3<f32> {
    return shown_smooth(smooth_normal(seen), seen, normal);
}
