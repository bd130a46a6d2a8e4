// The share of rays that meet a surface that alpha cuts out. `?alpha` tells alpha's texture.
// use shared/surface

/// Above all thresholds: alpha is the probability of being there.
const IS_BLENDED: f32 = 2.0;

/// Alpha where a material is blended, else all or none.
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
// No texture has a say in alpha.

fn alpha_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    return 1.0;
}

// choice texture
// Alpha of textures, at full size: an averaged alpha would move the edge of what it cuts out.

fn alpha_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    if slot == NO_SLOT {
        return 1.0;
    }
    return texel_alpha(slot, corners, weights);
}
