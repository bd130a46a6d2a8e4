// No material lets light through.
// use shared/scattering

/// Whether light comes through.
fn is_transmitting(bsdf: Bsdf) -> bool {
    return false;
}

/// Factor of radiance on its way out through the boundary, towards `outgoing`.
fn compression_of(bsdf: Bsdf) -> f32 {
    return 1.0;
}

/// Light that comes through.
fn transmitted_by(boundary: Boundary, incident: vec3<f32>) -> Evaluation {
    return no_evaluation();
}

/// A direction through a facet.
fn sample_transmitted(boundary: Boundary, facet: Facet, normal: vec3<f32>) -> BsdfSample {
    return no_bsdf_sample();
}
