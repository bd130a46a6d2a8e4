// Alpha of textures, at full size: an averaged alpha would move the edge of what it cuts out.

fn alpha_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    if slot == NO_SLOT {
        return 1.0;
    }
    return texel_alpha(slot, corners, weights);
}
