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
