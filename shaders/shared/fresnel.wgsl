// Reflectance of a smooth boundary; twin of crates/renderer/src/bsdf/microfacet.rs.

/// Result of `refracted_cosine` for total internal reflection.
const TOTAL: f32 = -1.0;

/// Cosine on the far side by Snell's law, from a cosine in 0..=1 and the refractive index of the far side divided by that of
/// the near side.
fn refracted_cosine(cosine: f32, eta: f32) -> f32 {
    // eta^2 - sin^2 without cancellation: for large cosines eta may be near 1, for small ones the cosine may be small.
    var square = eta * eta - (1.0 - cosine) * (1.0 + cosine);
    if cosine * cosine < 0.5 {
        square = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    }
    if square < 1e-36 {
        return TOTAL;
    }
    return sqrt(square) / eta;
}

/// Fresnel reflectance of unpolarized light between dielectrics; not for total internal reflection.
fn dielectric(cosine: f32, refracted: f32, eta: f32) -> f32 {
    let perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    let parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    return 0.5 * (perpendicular * perpendicular + parallel * parallel);
}

/// Schlick's approximation (1994) for a conductor with reflectance `normal` at normal incidence.
fn schlick(cosine: f32, normal: vec3<f32>) -> vec3<f32> {
    let sine = 1.0 - cosine;
    let square = sine * sine;
    return normal + (1.0 - normal) * (square * square * sine);
}

/// Lower bound of the cosine-weighted mean of `dielectric` over the hemisphere, close to it.
fn mean_below(eta: f32) -> f32 {
    let within = clamp(eta, 1.02, 4.0);
    return (within - 1.02) / (within + 4.25);
}
