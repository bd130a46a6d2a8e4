// Lights that are no triangles, world space, linear RGB.

const SUN: u32 = 0u;
const POINT: u32 = 1u;
const SPOT: u32 = 2u;
const SPHERE: u32 = 3u;
const DISK: u32 = 4u;

/// A light of the scene's list; what its kind does not have is zero.
struct ListLight {
    /// Of all but a sun.
    place: vec3<f32>,
    kind: u32,
    /// Unit vector: of a spot and a sun along the light, of a disc the normal of the side that shines.
    direction: vec3<f32>,
    /// Radius of a ball or a disc; cosine of the cone in which a spot is full.
    extent: f32,
    /// Irradiance of a sun, intensity of points and spots, radiance of bodies.
    color: vec3<f32>,
    /// Cosine of the cone beyond which a spot is dark.
    cos_outer: f32,
}
