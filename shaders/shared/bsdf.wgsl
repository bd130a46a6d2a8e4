// choice full
// All materials: metals, coated dielectrics, glass and thin walls.
// use shared/sampling
// use shared/scattering
// use shared/boundary
// use shared/ggx

/// Scattering from `incident` into `outgoing`, without delta lobes.
fn evaluate_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, incident: vec3<f32>) -> Evaluation {
    if outgoing.z < MIN_COSINE || abs(incident.z) < MIN_COSINE {
        return no_evaluation();
    }
    if is_lambert(bsdf) {
        let density = cosine_density(incident.z);
        return Evaluation(bsdf.base_color * density, density);
    }
    return evaluate_boundary(boundary_of(bsdf, outgoing), incident);
}

/// Samples an incident direction from a point of the unit square and a number in `[0, 1)` that selects a lobe.
fn sample_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, square: vec2<f32>, choice: f32) -> BsdfSample {
    if outgoing.z < MIN_COSINE {
        return no_bsdf_sample();
    }
    if is_lambert(bsdf) {
        let incident = cosine_hemisphere(square);
        return BsdfSample(incident, cosine_density(incident.z), bsdf.base_color, false, false, true);
    }
    let boundary = boundary_of(bsdf, outgoing);
    var scattered = sample_boundary(boundary, square, choice);
    if scattered.is_delta || !scattered.is_found {
        return scattered;
    }
    let found = evaluate_boundary(boundary, scattered.incident);
    // Rounding may move a direction at the edge of a lobe out of it.
    if found.density < MIN_DENSITY {
        return no_bsdf_sample();
    }
    scattered.weight = found.value / found.density;
    scattered.density = found.density;
    scattered.is_transmitted = scattered.incident.z < 0.0;
    return scattered;
}

/// Smaller densities may have been flushed to zero.
const MIN_DENSITY: f32 = 1e-30;

/// Whether `evaluate_bsdf` is zero everywhere, so that lights need not be sampled.
fn is_delta_only(bsdf: Bsdf) -> bool {
    return slope_width(bsdf.roughness) == 0.0 && all(diffuse_color(bsdf) == vec3(0.0));
}

fn is_lambert(bsdf: Bsdf) -> bool {
    return bsdf.metallic == 0.0 && bsdf.specular == 0.0 && bsdf.transmission == 0.0;
}

// choice lambert
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

/// Samples an incident direction from a point of the unit square.
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

/// Whether the material transmits light.
fn is_transmitting(bsdf: Bsdf) -> bool {
    return false;
}

/// Factor of the radiance that leaves through the boundary.
fn compression_of(bsdf: Bsdf) -> f32 {
    return 1.0;
}
