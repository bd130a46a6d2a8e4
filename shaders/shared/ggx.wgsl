// GGX microfacets (Trowbridge and Reitz 1975) with Smith's height-correlated masking; twin of crates/renderer/src/bsdf/microfacet.rs.
//
// Directions are unit vectors in the local frame. `outgoing` and facet normals have positive z.
// use shared/numbers
// use shared/angle

/// Smallest `alpha` that is not treated as a mirror.
const MIN_ALPHA: f32 = 1.0 / 1024.0;

/// `alpha` from glTF roughness; 0 for a mirror.
fn slope_width(roughness: f32) -> f32 {
    let alpha = roughness * roughness;
    return select(0.0, alpha, alpha >= MIN_ALPHA);
}

/// Density of facet area per solid angle and surface area.
fn ggx_distribution(alpha: f32, normal: vec3<f32>) -> f32 {
    // The tangent over alpha from the components: 1 - z^2 would lose all precision in a narrow lobe.
    let slope = normal.xy / alpha;
    let square = dot(slope, slope) + normal.z * normal.z;
    return 1.0 / (PI * (alpha * alpha) * (square * square));
}

/// Masking and shadowing divided by four outgoing cosines; both cosines are positive (Heitz 2014).
fn ggx_masking(alpha: f32, outgoing: f32, incident: f32) -> f32 {
    return 0.5 / (ggx_root(alpha, outgoing) + outgoing / incident * ggx_root(alpha, incident));
}

/// Density of `ggx_sample` divided by the cosine between `outgoing` and the facet, per solid angle of facet normals.
fn ggx_density(alpha: f32, outgoing: f32, normal: vec3<f32>) -> f32 {
    return 2.0 * ggx_distribution(alpha, normal) / (outgoing + ggx_root(alpha, outgoing));
}

/// Samples a visible facet normal from a point of the unit square (Heitz 2018, Dupuy and Benyoub 2023).
fn ggx_sample(alpha: f32, outgoing: vec3<f32>, square: vec2<f32>) -> vec3<f32> {
    let seen = unit_of(vec3(alpha * outgoing.xy, outgoing.z));
    // The spherical cap reaches from the pole to -seen.z; its height is (1 - square.y)(1 + seen.z) above that.
    let above = (1.0 - square.y) * (1.0 + seen.z);
    let depth = square.y * (1.0 + seen.z);
    // (1 + z)(1 - z) of the direction, each factor without cancellation.
    let sine = sqrt((above + (1.0 - seen.z)) * depth);
    return unit_of(vec3(alpha * (sine * circle(square.x) + seen.xy), above));
}

/// The cosine times Smith's square root of 1 + alpha^2 tan^2.
fn ggx_root(alpha: f32, cosine: f32) -> f32 {
    let square = alpha * alpha;
    return sqrt(square + (1.0 - square) * cosine * cosine);
}

/// Normalizes a nonzero vector. Scales first, because half vectors may be too short to square.
fn unit_of(v: vec3<f32>) -> vec3<f32> {
    let scaled = v / max(max(abs(v.x), abs(v.y)), abs(v.z));
    return scaled / sqrt(dot(scaled, scaled));
}
