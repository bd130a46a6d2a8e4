// Opacity of surfaces with alpha. `?alpha` reads the alpha texture.
// use shared/surface

/// Larger than any threshold: alpha is a probability of being hit.
const IS_BLENDED: f32 = 2.0;

/// Probability that a ray hits: alpha of a blended material, 0 or 1 otherwise.
fn presence(material: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    let cutoff = materials[material].cutoff;
    if cutoff < 0.0 {
        return 1.0;
    }
    let alpha = materials[material].alpha * alpha_of(materials[material].alpha_slot, corners, weights)
        * vertex_color(corners, weights).a;
    if cutoff < IS_BLENDED {
        return select(0.0, 1.0, alpha >= cutoff);
    }
    return alpha;
}

// choice plain
// No alpha texture.

fn alpha_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    return 1.0;
}

// choice texture
// Alpha textures, always at full resolution: averaging would move the edge of the cut-out.

fn alpha_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    if slot == NO_SLOT {
        return 1.0;
    }
    return texel_alpha(slot, corners, weights);
}
