// Diffuse surfaces only.
// use shared/sampling
// use shared/scattering

/// Scattering from `incident` into `outgoing`.
fn evaluate_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, incident: vec3<f32>) -> Evaluation {
    if outgoing.z < MIN_COSINE || incident.z < MIN_COSINE {
        return no_evaluation();
    }
    let density = cosine_density(incident.z);
    return Evaluation(bsdf.base_color * density, density);
}

/// A direction to look for light in, from a point of the unit square.
fn sample_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, square: vec2<f32>, choice: f32) -> BsdfSample {
    if outgoing.z < MIN_COSINE {
        return no_bsdf_sample();
    }
    let incident = cosine_hemisphere(square);
    return BsdfSample(incident, cosine_density(incident.z), bsdf.base_color, false, false, true);
}

/// Whether `evaluate_bsdf` is zero everywhere.
fn is_delta_only(bsdf: Bsdf) -> bool {
    return false;
}

/// Whether light comes through.
fn is_transmitting(bsdf: Bsdf) -> bool {
    return false;
}

/// Factor of radiance on its way out through the boundary.
fn compression_of(bsdf: Bsdf) -> f32 {
    return 1.0;
}
