// choice full
// All materials: metals, coated dielectrics, glass and thin walls.
// use shared/bsdf/every

/// Scattering from `incident` into `outgoing`, without delta lobes.
fn evaluate_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, incident: vec3<f32>) -> Evaluation {
    return evaluate_material(bsdf, outgoing, incident);
}

/// Samples an incident direction from a point of the unit square and a number in `[0, 1)` that selects a lobe.
fn sample_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, square: vec2<f32>, choice: f32) -> BsdfSample {
    return sample_material(bsdf, outgoing, square, choice);
}

// choice hair
// All materials, and hair: what `fiber` says, if it is on.
// use shared/bsdf/every
// use shared/hair

/// Scattering from `incident` into `outgoing`, without delta lobes.
fn evaluate_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, incident: vec3<f32>) -> Evaluation {
    if fiber.is_on {
        return evaluate_hair(outgoing, incident);
    }
    return evaluate_material(bsdf, outgoing, incident);
}

/// Samples an incident direction from a point of the unit square and a number in `[0, 1)` that selects a lobe.
fn sample_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, square: vec2<f32>, choice: f32) -> BsdfSample {
    if fiber.is_on {
        return sample_hair(outgoing, square, choice);
    }
    return sample_material(bsdf, outgoing, square, choice);
}

// part every
// Metals, coated dielectrics, glass and thin walls.
// use shared/sampling
// use shared/bsdf/diffuse
// use shared/bsdf/scattering
// use shared/bsdf/boundary
// use shared/bsdf/ggx

/// Scattering from `incident` into `outgoing`, without delta lobes.
fn evaluate_material(bsdf: Bsdf, outgoing: vec3<f32>, incident: vec3<f32>) -> Evaluation {
    if outgoing.z < MIN_COSINE || abs(incident.z) < MIN_COSINE {
        return no_evaluation();
    }
    if is_lambert(bsdf) {
        return Evaluation(bsdf.base_color * cosine_density(incident.z), hemisphere_density(incident.z));
    }
    return evaluate_boundary(boundary_of(bsdf, outgoing), incident);
}

/// Samples an incident direction from a point of the unit square and a number in `[0, 1)` that selects a lobe.
fn sample_material(bsdf: Bsdf, outgoing: vec3<f32>, square: vec2<f32>, choice: f32) -> BsdfSample {
    if outgoing.z < MIN_COSINE {
        return no_bsdf_sample();
    }
    if is_lambert(bsdf) {
        return lambert_sample(bsdf.base_color, square);
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

/// Whether `evaluate_bsdf` is zero everywhere, so that lights need not be sampled; never for hair, which is rough.
fn is_delta_only(bsdf: Bsdf) -> bool {
    return slope_width(bsdf.roughness) == 0.0 && all(diffuse_color(bsdf) == vec3(0.0));
}

fn is_lambert(bsdf: Bsdf) -> bool {
    return bsdf.metallic == 0.0 && bsdf.specular == 0.0 && bsdf.transmission == 0.0;
}

// choice lambert
// Diffuse surfaces only.
// use shared/sampling
// use shared/bsdf/diffuse
// use shared/bsdf/scattering

/// Scattering from `incident` into `outgoing`.
fn evaluate_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, incident: vec3<f32>) -> Evaluation {
    if outgoing.z < MIN_COSINE || incident.z < MIN_COSINE {
        return no_evaluation();
    }
    return Evaluation(bsdf.base_color * cosine_density(incident.z), hemisphere_density(incident.z));
}

/// Samples an incident direction from a point of the unit square.
fn sample_bsdf(bsdf: Bsdf, outgoing: vec3<f32>, square: vec2<f32>, choice: f32) -> BsdfSample {
    if outgoing.z < MIN_COSINE {
        return no_bsdf_sample();
    }
    return lambert_sample(bsdf.base_color, square);
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

// part scattering
// Interface of BSDFs, implemented by the parts of `shared/bsdf`; twin of crates/renderer/src/bsdf.rs.
//
// Directions are unit vectors in a local frame. +z is the shading normal on the side of `outgoing`, which points towards the
// viewer. Light comes from `incident`; it is transmitted if the z of `incident` is negative.

/// Material at a hit, and the side that the ray came from.
struct Bsdf {
    base_color: vec3<f32>,
    metallic: f32,
    roughness: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    thin_walled: bool,
    /// Only thick transmissive materials have an inside.
    is_inside: bool,
}

/// Scattering from one direction into another, without delta lobes.
struct Evaluation {
    /// BSDF times the absolute cosine of `incident`.
    value: vec3<f32>,
    /// Density of sampling `incident`, per steradian.
    density: f32,
}

/// A sampled incident direction.
struct BsdfSample {
    incident: vec3<f32>,
    /// Per steradian; 0 if `is_delta`.
    density: f32,
    /// Factor of the incident radiance.
    weight: vec3<f32>,
    is_delta: bool,
    is_transmitted: bool,
    /// False if no light is scattered.
    is_found: bool,
}

/// Smaller cosines count as the horizon; the quotient of two larger ones can be multiplied without overflow.
const MIN_COSINE: f32 = 1e-18;

fn no_evaluation() -> Evaluation {
    return Evaluation(vec3(0.0), 0.0);
}

fn no_bsdf_sample() -> BsdfSample {
    return BsdfSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), false, false, false);
}

// part diffuse
// Samples of diffuse surfaces; `?hemisphere` chooses directions.
// use shared/bsdf/scattering
// use ?hemisphere

/// A sample of a surface that is only diffuse.
fn lambert_sample(color: vec3<f32>, square: vec2<f32>) -> BsdfSample {
    let incident = hemisphere_direction(square);
    let weight = color * hemisphere_weight(incident.z);
    return BsdfSample(incident, hemisphere_density(incident.z), weight, false, false, true);
}

// part fresnel
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

// part ggx
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

// part boundary
// A layered boundary for one outgoing direction; twin of crates/renderer/src/bsdf/boundary.rs, which explains each step.
//
// `?transmission` handles transmitted light; it is empty in scenes without glass. `?energy` gives back what microfacets lose.
// use shared/numbers
// use shared/sampling
// use shared/bsdf/scattering
// use shared/bsdf/fresnel
// use shared/bsdf/ggx
// use ?hemisphere
// use ?transmission
// use ?energy

/// Smallest difference of `eta` from 1 at which a rough boundary refracts; below, light passes straight.
const MIN_ETA_DIFFERENCE: f32 = 1.0 / 128.0;

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
    /// Factor of what is transmitted.
    transmission_gain: f32,
    /// Factor of what the dielectric reflects.
    reflection_gain: f32,
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
    var boundary = Boundary(bsdf, outgoing, is_inside, eta, slope_width(bsdf.roughness), 0.0, 1.0, 1.0, 0.0);
    compensate(&boundary);
    boundary.diffuse_probability = share_of_base(boundary);
    return boundary;
}

/// Whether a rough boundary refracts by more than rounding does.
fn bends(boundary: Boundary) -> bool {
    return abs(boundary.eta - 1.0) >= MIN_ETA_DIFFERENCE;
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
    let diffuse = Evaluation(base_of(boundary, incident.z) * lambert, boundary.diffuse_probability * hemisphere_density(incident.z));
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
        return into_lobe(hemisphere_direction(square));
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
    let of_side = select(1.0, bsdf.transmission, boundary.is_inside);
    let gloss = (1.0 - bsdf.metallic) * layer * of_side * boundary.reflection_gain;
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

// choice transmission/none
// No transmissive materials.
// use shared/bsdf/scattering

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

// choice transmission/glass
// Transmission: refraction for glass, none for thin walls. Part of `shared/bsdf/boundary`.
// use shared/bsdf/scattering
// use shared/bsdf/fresnel
// use shared/bsdf/ggx

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

// choice energy/single
// Single scattering: what facets lose is lost.
// use shared/bsdf/fresnel

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

// choice energy/compensated
// Metal, coats and thin walls get back what their facets lose; no glass refracts.
// use shared/bsdf/energy/gains

/// Factor of what rough glass reflects and refracts.
fn glass_gain(boundary: Boundary) -> f32 {
    return 1.0;
}

// choice energy/refracting
// Metal, coats, thin walls and rough glass get back what their facets lose.
// use shared/bsdf/energy/gains

/// Albedo of white glass without a reflection where it is not total, and what the whole reflection adds: by the side, the index of
/// refraction, the roughness and the cosine; see crates/renderer/src/bsdf/glass.rs.
@group(2) @binding(10) var<storage, read> glass_albedos: array<vec2<f32>>;

const N_IORS: u32 = 16u;
const N_ROUGHNESSES: u32 = 12u;
const N_COSINES: u32 = 12u;
const MIN_ROUGHNESS: f32 = 1.0 / 32.0;

/// Smaller albedos of glass count as this.
const MIN_ALBEDO: f32 = 0.1;

/// Factor of what rough glass reflects and refracts.
fn glass_gain(boundary: Boundary) -> f32 {
    let bsdf = boundary.bsdf;
    if bsdf.transmission <= 0.0 || bsdf.thin_walled || !bends(boundary) {
        return 1.0;
    }
    let i = place_in(sqrt((bsdf.ior - 1.0) / (bsdf.ior + 1.0)), N_IORS);
    let j = place_in((bsdf.roughness - MIN_ROUGHNESS) / (1.0 - MIN_ROUGHNESS), N_ROUGHNESSES);
    let k = place_in(sqrt(boundary.outgoing.z), N_COSINES);
    let first = ((select(0u, N_IORS, boundary.is_inside) + i.first) * N_ROUGHNESSES + j.first) * N_COSINES + k.first;
    let next = first + N_ROUGHNESSES * N_COSINES;
    let here = mix(along_cosine(first, k.rest), along_cosine(first + N_COSINES, k.rest), j.rest);
    let there = mix(along_cosine(next, k.rest), along_cosine(next + N_COSINES, k.rest), j.rest);
    let albedo = mix(here, there, i.rest);
    return 1.0 / max(albedo.x + bsdf.specular * albedo.y, MIN_ALBEDO);
}

fn along_cosine(first: u32, rest: f32) -> vec2<f32> {
    return mix(glass_albedos[first], glass_albedos[first + 1u], rest);
}

/// The entry before a number in 0..=1, and the way from it to the next.
struct Place {
    first: u32,
    rest: f32,
}

fn place_in(number: f32, n: u32) -> Place {
    let x = clamp(number, 0.0, 1.0) * f32(n - 1u);
    let first = min(u32(x), n - 2u);
    return Place(first, x - f32(first));
}

// part energy/gains
// What facets lose, and the factors that give it back. `glass_gain` is that of rough glass.
// use shared/bsdf/fresnel

fn compensate(boundary: ptr<function, Boundary>) {
    if (*boundary).alpha == 0.0 {
        return;
    }
    let bsdf = (*boundary).bsdf;
    let cosine = (*boundary).outgoing.z;
    let gain = glass_gain(*boundary);
    (*boundary).transmission_gain = gain;
    // From outside, only a part of the reflection belongs to glass: that over a diffuse base loses nothing.
    (*boundary).reflection_gain = 1.0 + select(bsdf.transmission, 1.0, (*boundary).is_inside) * (gain - 1.0);
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
