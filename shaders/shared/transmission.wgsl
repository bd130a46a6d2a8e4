// choice none
// No transmissive materials.
// use shared/scattering

/// Whether the material transmits light.
fn is_transmitting(bsdf: Bsdf) -> bool {
    return false;
}

/// Factor of the radiance that leaves through the boundary towards `outgoing`.
fn compression_of(bsdf: Bsdf) -> f32 {
    return 1.0;
}

/// Transmitted light.
fn transmitted_by(boundary: Boundary, incident: vec3<f32>) -> Evaluation {
    return no_evaluation();
}

/// Samples a transmitted direction.
fn sample_transmitted(boundary: Boundary, facet: Facet, normal: vec3<f32>) -> BsdfSample {
    return no_bsdf_sample();
}

// choice glass
// Transmission: refraction for glass, none for thin walls. Part of `shared/boundary`.
// use shared/scattering
// use shared/fresnel
// use shared/ggx

/// Smallest difference of `eta` from 1 at which a rough boundary refracts; below, light passes straight.
const MIN_ETA_DIFFERENCE: f32 = 1.0 / 128.0;

/// Whether the material transmits light.
fn is_transmitting(bsdf: Bsdf) -> bool {
    return bsdf.transmission > 0.0;
}

/// Factor of the radiance that leaves through the boundary towards `outgoing`.
fn compression_of(bsdf: Bsdf) -> f32 {
    let square = bsdf.ior * bsdf.ior;
    return select(select(1.0 / square, square, bsdf.is_inside), 1.0, bsdf.thin_walled);
}

/// Transmitted light.
fn transmitted_by(boundary: Boundary, incident: vec3<f32>) -> Evaluation {
    if boundary.alpha == 0.0 || boundary.bsdf.transmission <= 0.0 {
        return no_evaluation();
    }
    if boundary.bsdf.thin_walled {
        return mirrored_by(boundary, vec3(incident.xy, -incident.z), true);
    }
    return refracted_by(boundary, incident);
}

/// Facets that refract `incident` into `outgoing` (Walter et al. 2007, equations 16, 17 and 21).
fn refracted_by(boundary: Boundary, incident: vec3<f32>) -> Evaluation {
    if !bends(boundary) {
        return no_evaluation();
    }
    let eta = boundary.eta;
    // The half vector lies along no + eta * ni, on the side of the optically thinner medium.
    let sum = unit_of(boundary.outgoing + eta * incident);
    let normal = select(sum, -sum, sum.z < 0.0);
    let near = dot(boundary.outgoing, normal);
    let far = dot(incident, normal);
    if near <= 0.0 || far >= 0.0 {
        return no_evaluation();
    }
    let facet = facet_of(boundary, near);
    // Jacobian from normals to directions. By Snell's law the sum is at least 1 - 1 / eta in absolute value.
    let sum_of_cosines = far + near / eta;
    let stretch = quotient(-far, sum_of_cosines * sum_of_cosines);
    let masking = 4.0 * near * ggx_masking(boundary.alpha, boundary.outgoing.z, -incident.z);
    let area = ggx_distribution(boundary.alpha, normal) * masking * stretch / (eta * eta);
    let density = near * ggx_density(boundary.alpha, boundary.outgoing.z, normal) * stretch;
    let probability = (1.0 - boundary.diffuse_probability) * (1.0 - facet.reflection_probability);
    return Evaluation(facet.transmitted * area, probability * density);
}

/// Samples a transmitted direction. The weight is set only for delta lobes.
fn sample_transmitted(boundary: Boundary, facet: Facet, normal: vec3<f32>) -> BsdfSample {
    let outgoing = boundary.outgoing;
    let eta = boundary.eta;
    let probability = 1.0 - facet.reflection_probability;
    if boundary.bsdf.thin_walled {
        if boundary.alpha == 0.0 {
            return mirror(boundary, -outgoing, facet.transmitted, probability);
        }
        let incident = mirrored_at(outgoing, normal);
        if incident.z < MIN_COSINE {
            return no_bsdf_sample();
        }
        return into_lobe(vec3(incident.xy, -incident.z));
    }
    let color = facet.transmitted / (eta * eta);
    if boundary.alpha > 0.0 && !bends(boundary) {
        return mirror(boundary, -outgoing, color, probability);
    }
    let cosine = dot(outgoing, normal);
    let refracted = refracted_cosine(cosine, eta);
    if refracted == TOTAL {
        return no_bsdf_sample();
    }
    // Snell's law divides the tangential part by eta, and its error if the far side is optically thinner.
    let tangent = outgoing - cosine * normal;
    let incident = unit_of(-tangent / eta - refracted * normal);
    if boundary.alpha == 0.0 {
        return mirror(boundary, incident, color, probability);
    }
    if incident.z > -MIN_COSINE {
        return no_bsdf_sample();
    }
    return into_lobe(incident);
}

/// Whether a rough boundary refracts by more than rounding does.
fn bends(boundary: Boundary) -> bool {
    return abs(boundary.eta - 1.0) >= MIN_ETA_DIFFERENCE;
}
