// Squares of texels.

/// As wide as the longer axis of what the cone covers: `log2(√(texels over area of the triangle) · width / cosine)`.
fn square_footprint(seen: Seen, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    let n_texels_root = sqrt(abs(determinant(along)) * texels.x * texels.y);
    let cosine = abs(dot(seen.winding, seen.direction));
    // Both ends of the range are left to the clamp of the lookup; what is zero is kept from the logarithm.
    let width = log2(max(n_texels_root, 1e-30)) + log2(max(seen.cone.width, 1e-30));
    return Footprint(width - log2(max(seen.area_root, 1e-30)) - log2(max(cosine, 1e-30)), vec2(0.0), 1u);
}
