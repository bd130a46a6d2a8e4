// Listed lights: everything but emissive triangles and the sky. World space, linear RGB.

const SUN: u32 = 0u;
const POINT: u32 = 1u;
const SPOT: u32 = 2u;
const SPHERE: u32 = 3u;
const DISK: u32 = 4u;

/// A listed light. Fields that its kind does not use are zero.
struct ListLight {
    /// Position of all but a sun.
    position: vec3<f32>,
    kind: u32,
    /// Unit vector: direction of the light of spots and suns, normal of the emitting side of a disk.
    direction: vec3<f32>,
    /// Radius of a sphere or disk; cosine of the inner cone of a spot.
    extent: f32,
    /// Irradiance of a sun, intensity of points and spots, radiance of spheres and disks.
    color: vec3<f32>,
    /// Cosine of the outer cone of a spot.
    cos_outer: f32,
}

// part lights
// The listed lights of the scene.

@group(3) @binding(0) var<storage, read> lights: array<ListLight>;

// part sampled
// Sampling of local listed lights.
// use shared/light/list/lights
// use shared/light/sample
// use shared/light/tree

/// Leaf of each listed light in the light tree; `NO_LEAF` for suns.
@group(3) @binding(7) var<storage, read> light_leaves: array<u32>;

const NO_LEAF: u32 = 0xffffffffu;

/// Samples a listed light.
fn sample_listed(number: u32, at: vec3<f32>, square: vec2<f32>) -> LightSample {
    return LightSample(incoming_light(lights[number], at, square), number, false);
}

/// Density of a unit direction that hits a shape light, including the probability of choosing it.
fn shape_density(receiver: Receiver, number: u32, direction: vec3<f32>) -> f32 {
    let light = lights[number];
    let leaf = light_leaves[number];
    if leaf == NO_LEAF {
        return 0.0;
    }
    var density = disk_density(light, receiver.position, direction);
    if light.kind == SPHERE {
        density = sphere_density(light, receiver.position);
    }
    return light_probability(leaf, receiver) * density;
}
