// A layered boundary for one outgoing direction; twin of crates/renderer/src/bsdf/boundary.rs, which explains each step.
//
// `?transmission` handles transmitted light; it is empty in scenes without glass. `?energy` gives back what microfacets lose.
// use shared/numbers
// use shared/sampling
// use shared/scattering
// use shared/fresnel
// use shared/ggx
// use ?transmission
// use ?energy

/// A material and an outgoing direction.
struct Boundary {
    bsdf: Bsdf,
    outgoing: vec3<f32>,
    is_inside: bool,
    /// Refractive index of the far side divided by that of the side of `outgoing`.
    eta: f32,
    /// 0 for a mirror.
    alpha: f32,
    /// What a metal reflects is multiplied by 1 plus this times its base color.
    metal_gain: f32,
    /// Factor of what a thin wall transmits.
    transmission_gain: f32,
    diffuse_probability: f32,
}

/// What a microfacet reflects and transmits for one direction.
struct Facet {
    reflected: vec3<f32>,
    transmitted: vec3<f32>,
    /// Probability of reflection once this facet is sampled; the rest is transmission.
    reflection_probability: f32,
}

fn boundary_of(bsdf: Bsdf, outgoing: vec3<f32>) -> Boundary {
    let is_inside = bsdf.is_inside && bsdf.transmission > 0.0 && !bsdf.thin_walled;
    let eta = select(bsdf.ior, 1.0 / bsdf.ior, is_inside);
    var boundary = Boundary(bsdf, outgoing, is_inside, eta, slope_width(bsdf.roughness), 0.0, 1.0, 0.0);
    compensate(&boundary);
    boundary.diffuse_probability = share_of_base(boundary);
    return boundary;
}

/// Light from `incident`, whose z is not 0.
fn evaluate_boundary(boundary: Boundary, incident: vec3<f32>) -> Evaluation {
    if incident.z > 0.0 {
        return reflected_by(boundary, incident);
    }
    return transmitted_by(boundary, incident);
}

/// Reflected light.
fn reflected_by(boundary: Boundary, incident: vec3<f32>) -> Evaluation {
    let lambert = incident.z / PI;
    let diffuse = Evaluation(base_of(boundary, incident.z) * lambert, boundary.diffuse_probability * lambert);
    if boundary.alpha == 0.0 {
        return diffuse;
    }
    let gloss = mirrored_by(boundary, incident, false);
    return Evaluation(diffuse.value + gloss.value, diffuse.density + gloss.density);
}

/// Facets that mirror `incident` into `outgoing`: their reflection, or the transmission of a thin wall.
fn mirrored_by(boundary: Boundary, incident: vec3<f32>, is_through: bool) -> Evaluation {
    let normal = unit_of(boundary.outgoing + incident);
    let facet = facet_of(boundary, dot(boundary.outgoing, normal));
    let color = select(facet.reflected, facet.transmitted, is_through);
    let probability = select(facet.reflection_probability, 1.0 - facet.reflection_probability, is_through);
    let outgoing = boundary.outgoing.z;
    let area = ggx_distribution(boundary.alpha, normal) * ggx_masking(boundary.alpha, outgoing, incident.z);
    // The Jacobian from normals to directions is four times the cosine to the facet; the cosine cancels.
    let density = ggx_density(boundary.alpha, outgoing, normal) / 4.0;
    return Evaluation(color * area, (1.0 - boundary.diffuse_probability) * probability * density);
}

/// Samples a direction from one lobe. The weight is set only for delta lobes.
fn sample_boundary(boundary: Boundary, square: vec2<f32>, choice: f32) -> BsdfSample {
    if choice < boundary.diffuse_probability {
        return into_lobe(cosine_hemisphere(square));
    }
    // Reuse the rest of the random number.
    let left = (choice - boundary.diffuse_probability) / (1.0 - boundary.diffuse_probability);
    var normal = vec3(0.0, 0.0, 1.0);
    if boundary.alpha > 0.0 {
        normal = ggx_sample(boundary.alpha, boundary.outgoing, square);
    }
    let facet = facet_of(boundary, dot(boundary.outgoing, normal));
    if left < facet.reflection_probability {
        return sample_reflected(boundary, facet, normal);
    }
    return sample_transmitted(boundary, facet, normal);
}

fn sample_reflected(boundary: Boundary, facet: Facet, normal: vec3<f32>) -> BsdfSample {
    let outgoing = boundary.outgoing;
    if boundary.alpha == 0.0 {
        return mirror(boundary, vec3(-outgoing.xy, outgoing.z), facet.reflected, facet.reflection_probability);
    }
    let incident = mirrored_at(outgoing, normal);
    if incident.z < MIN_COSINE {
        return no_bsdf_sample();
    }
    return into_lobe(incident);
}

/// A direction of a lobe that is not a delta.
fn into_lobe(incident: vec3<f32>) -> BsdfSample {
    return BsdfSample(incident, 0.0, vec3(0.0), false, false, true);
}

/// The direction of a delta lobe.
fn mirror(boundary: Boundary, incident: vec3<f32>, color: vec3<f32>, share: f32) -> BsdfSample {
    let probability = share * (1.0 - boundary.diffuse_probability);
    if probability <= 0.0 {
        return no_bsdf_sample();
    }
    return BsdfSample(incident, 0.0, color * quotient(1.0, probability), true, incident.z < 0.0, true);
}

/// The direction that a facet mirrors `outgoing` into.
fn mirrored_at(outgoing: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    return 2.0 * dot(outgoing, normal) * normal - outgoing;
}

fn facet_of(boundary: Boundary, cosine_to_facet: f32) -> Facet {
    let bsdf = boundary.bsdf;
    // Rounding may leave the cosine slightly outside the range.
    let cosine = clamp(cosine_to_facet, 0.0, 1.0);
    let layer = layer_of(boundary, cosine);
    let gloss = (1.0 - bsdf.metallic) * layer * select(1.0, bsdf.transmission, boundary.is_inside);
    let metal = bsdf.metallic * schlick(cosine, bsdf.base_color) * (1.0 + bsdf.base_color * boundary.metal_gain);
    let reflected = metal + gloss;
    let transmitted = ((1.0 - bsdf.metallic) * bsdf.transmission * (1.0 - layer) * boundary.transmission_gain) * bsdf.base_color;
    let r = mean_of(reflected);
    let t = mean_of(transmitted);
    var probability = 1.0;
    if t > 0.0 {
        probability = r / (r + t);
    }
    return Facet(reflected, transmitted, probability);
}

/// Albedo of the diffuse base under the layer, for light of this cosine; from inside, the base lies before the layer.
fn base_of(boundary: Boundary, incident: f32) -> vec3<f32> {
    let color = diffuse_color(boundary.bsdf);
    if boundary.is_inside {
        return color;
    }
    let passed = (1.0 - layer_albedo(boundary, boundary.outgoing.z)) * (1.0 - layer_albedo(boundary, incident));
    return color * passed / (1.0 - boundary.bsdf.specular * mean_reflectance(boundary));
}

/// Reflectance of the dielectric layer; total internal reflection ignores `specular`.
fn layer_of(boundary: Boundary, cosine: f32) -> f32 {
    let refracted = refracted_cosine(cosine, boundary.eta);
    if refracted == TOTAL {
        return 1.0;
    }
    return boundary.bsdf.specular * dielectric(cosine, refracted, boundary.eta);
}

/// Fraction of the light along the mirrored direction that the diffuse base reflects.
fn share_of_base(boundary: Boundary) -> f32 {
    var passed = 1.0;
    if !boundary.is_inside {
        passed = 1.0 - layer_albedo(boundary, boundary.outgoing.z);
    }
    let base = mean_of(diffuse_color(boundary.bsdf)) * passed;
    let facet = facet_of(boundary, boundary.outgoing.z);
    // A black metal still reflects at grazing angles.
    if base <= 0.0 {
        return 0.0;
    }
    return base / (base + mean_of(facet.reflected) + mean_of(facet.transmitted));
}

/// Albedo of the diffuse base without the layer.
fn diffuse_color(bsdf: Bsdf) -> vec3<f32> {
    return bsdf.base_color * ((1.0 - bsdf.metallic) * (1.0 - bsdf.transmission));
}

fn mean_of(color: vec3<f32>) -> f32 {
    return (color.x + color.y + color.z) / 3.0;
}
