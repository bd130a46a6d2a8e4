// Shares of light that a flat boundary reflects; twin of crates/renderer/src/bsdf/fresnel.rs.

/// What `refracted_cosine` answers where the reflection is total.
const TOTAL: f32 = -1.0;

/// Cosine on the far side by Snell's law, from a cosine in 0..=1 and the index of the far side over the near one's.
fn refracted_cosine(cosine: f32, eta: f32) -> f32 {
    // eta^2 - sin^2, in the form that does not cancel: above half a right angle eta may be near 1, below it small.
    var square = eta * eta - (1.0 - cosine) * (1.0 + cosine);
    if cosine * cosine < 0.5 {
        square = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    }
    if square < 1e-36 {
        return TOTAL;
    }
    return sqrt(square) / eta;
}

/// Reflectance of unpolarised light at a boundary of dielectrics, by Fresnel's equations; not for total reflection.
fn dielectric(cosine: f32, refracted: f32, eta: f32) -> f32 {
    let perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    let parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    return 0.5 * (perpendicular * perpendicular + parallel * parallel);
}

/// Schlick's approximation (1994) for a conductor of reflectance `normal` at normal incidence.
fn schlick(cosine: f32, normal: vec3<f32>) -> vec3<f32> {
    let sine = 1.0 - cosine;
    let square = sine * sine;
    return normal + (1.0 - normal) * (square * square * sine);
}

/// The cosine-weighted mean of `dielectric` over the hemisphere, or a little less.
fn mean_below(eta: f32) -> f32 {
    let within = clamp(eta, 1.02, 4.0);
    return (within - 1.02) / (within + 4.25);
}
