// How a surface scatters light: what the files of `shared/bsdf/` take and answer; twin of crates/renderer/src/bsdf.rs.
//
// Directions are unit vectors in a local frame: +z is the shading normal on the side of `outgoing`, which points
// towards the viewer; light arrives from `incident`, through the surface where its z is below 0.

/// The material at a hit and the side from which a ray arrived.
struct Bsdf {
    base_color: vec3<f32>,
    metallic: f32,
    roughness: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    thin_walled: bool,
    /// Only what transmits and is not thin has an inside.
    is_inside: bool,
}

/// What all lobes but the mirrors scatter from one direction into another.
struct Evaluation {
    /// The scattering function times the absolute cosine of `incident`.
    value: vec3<f32>,
    /// With which `incident` is sampled, per steradian.
    density: f32,
}

/// A direction that light may arrive from.
struct BsdfSample {
    incident: vec3<f32>,
    /// Per steradian; 0 where `is_delta`.
    density: f32,
    /// What the radiance from there is multiplied with.
    weight: vec3<f32>,
    is_delta: bool,
    is_transmitted: bool,
    /// False where nothing arrives.
    is_found: bool,
}

/// Cosines below it count as the horizon: the quotient of two that are not can be multiplied without overflow.
const MIN_COSINE: f32 = 1e-18;

fn no_evaluation() -> Evaluation {
    return Evaluation(vec3(0.0), 0.0);
}

fn no_bsdf_sample() -> BsdfSample {
    return BsdfSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), false, false, false);
}
