// No material has a texture.

fn texel(slot: u32, seen: Seen) -> vec4<f32> {
    return vec4(1.0);
}

fn texel_alpha(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    return 1.0;
}

fn uv_edges(slot: u32, seen: Seen) -> mat2x2<f32> {
    return mat2x2(vec2(0.0), vec2(0.0));
}
