// What rough boundaries lose by multiple scattering, and what gives it back; twin of crates/renderer/src/bsdf/boundary.rs.

// choice single
// Single scattering: what facets lose is lost.
// use shared/fresnel

fn compensate(boundary: ptr<function, Boundary>) {}

/// Part of the light from a direction that the coat as a whole reflects.
fn layer_albedo(boundary: Boundary, cosine: f32) -> f32 {
    return layer_of(boundary, cosine);
}

/// Mean of the reflectance of the coat over the hemisphere, for `specular` 1.
fn mean_reflectance(boundary: Boundary) -> f32 {
    // At most a third.
    return mean_below(boundary.eta);
}

// choice compensated
// Metal, coats and thin walls get back what their facets lose.
// use shared/fresnel

fn compensate(boundary: ptr<function, Boundary>) {
    if (*boundary).alpha == 0.0 {
        return;
    }
    let bsdf = (*boundary).bsdf;
    let cosine = (*boundary).outgoing.z;
    let albedo = facet_albedo(cosine, bsdf.roughness);
    (*boundary).metal_gain = (1.0 - albedo) / albedo;
    if bsdf.thin_walled {
        let facet_layer = layer_of(*boundary, effective_cosine(cosine, bsdf.roughness));
        (*boundary).transmission_gain = (1.0 - albedo * facet_layer) / (albedo * max(1.0 - facet_layer, MIN_PASSED));
    }
}

/// Smaller transmittances count as this.
const MIN_PASSED: f32 = 1e-3;

fn layer_albedo(boundary: Boundary, cosine: f32) -> f32 {
    if boundary.alpha == 0.0 {
        return layer_of(boundary, cosine);
    }
    let roughness = boundary.bsdf.roughness;
    return facet_albedo(cosine, roughness) * layer_of(boundary, effective_cosine(cosine, roughness));
}

fn mean_reflectance(boundary: Boundary) -> f32 {
    if boundary.alpha == 0.0 {
        return mean_below(boundary.eta);
    }
    let r = boundary.bsdf.roughness;
    let eta = clamp(boundary.eta, 1.0, 4.0);
    let n = (eta - 1.0) / (eta + 1.0);
    let one = 1.3273436 + n * ((-1.2267793) + n * 1.2081856);
    let linear = (-1.7918327) + n * (5.616328 + n * (-4.4670687));
    let square = 0.44777808 + n * ((-3.2862773) + n * 2.5457828);
    return (one + r * (linear + r * square)) * (eta - 1.0) / (eta + 4.25);
}

/// Albedo of white facets with single scattering.
fn facet_albedo(cosine: f32, r: f32) -> f32 {
    let s = energy_variable(cosine, r);
    let p = powers(r);
    var sum = row(vec4(-14.06146, -87.00478, 432.94437, -577.06775), 246.90771, p);
    sum = sum * s + row(vec4(38.815273, 242.16681, -1155.6523, 1522.6134), -653.48334, p);
    sum = sum * s + row(vec4(-38.811775, -248.2274, 1138.2389, -1499.6288), 654.9688, p);
    sum = sum * s + row(vec4(17.811588, 113.0354, -503.92072, 678.4959), -308.38388, p);
    sum = sum * s + row(vec4(-4.063187, -21.58304, 96.69958, -139.5704), 68.386375, p);
    sum = sum * s + row(vec4(0.3289856, 1.2405112, -5.7699223, 9.250136), -5.371819, p);
    sum = sum * s + row(vec4(0.99442667, -0.0046965606, 0.041189846, -0.09276388), 0.06731132, p);
    return clamp(sum, 0.2, 1.0);
}

/// The cosine at which the reflectance is the mean over the facets that reflect light to a direction.
fn effective_cosine(cosine: f32, r: f32) -> f32 {
    let s = energy_variable(cosine, r);
    let p = powers(r);
    var sum = row(vec4(-6.960863, 47.86098, -134.71822, 160.38995), -66.25904, p);
    sum = sum * s + row(vec4(5.701652, -49.421364, 147.20836, -176.556), 72.33108, p);
    sum = sum * s + row(vec4(-4.4519277, 26.359417, -66.78361, 72.839836), -27.975342, p);
    sum = sum * s + row(vec4(0.17437683, -1.5628386, 4.650756, -5.6139894), 2.3578134, p);
    sum = sum * s + row(vec4(4.7165737, -18.228926, 36.795284, -35.958527), 13.18787, p);
    return clamp(cosine + r * r * sum, 0.0, 1.0);
}

fn energy_variable(cosine: f32, r: f32) -> f32 {
    let alpha = r * r;
    return sqrt(cosine * (1.0 + alpha) / (cosine + alpha));
}

fn powers(r: f32) -> vec4<f32> {
    return vec4(1.0, r, r * r, r * r * r);
}

/// A polynomial of degree four, from the powers below.
fn row(low: vec4<f32>, last: f32, p: vec4<f32>) -> f32 {
    return dot(low, p) + last * (p.y * p.w);
}
