// Listed lights: everything but emissive triangles and the sky. World space, linear RGB.
//
// A kind of light is a file of its name. The switches of this file are the only places that list the kinds, and each lists all of them.
//
// All in f32. Results have a relative error of a few ULP of the largest coordinate over the distance, as the input has.
// use shared/light/sun
// use shared/light/point
// use shared/light/spot
// use shared/light/sphere
// use shared/light/disk

// The kinds, by the order of `Light::KINDS` in crates/scene.
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

/// No light.
const NO_LIGHT: u32 = 0u;
/// The shadow ray ends at `position`.
const FINITE: u32 = 1u;
/// The shadow ray along `to_light` is infinite.
const INFINITE: u32 = 2u;

/// Light that would arrive at a point.
struct IncomingLight {
    /// Unit vector.
    to_light: vec3<f32>,
    /// Density of `to_light` per steradian; 0 for a light without extent.
    density: f32,
    /// Radiance over density; for a light without extent, the irradiance on a surface that faces it.
    radiance: vec3<f32>,
    /// The shadow ray: `NO_LIGHT`, `FINITE` or `INFINITE`.
    shadow_ray: u32,
    /// Position on the light, for a finite shadow ray.
    position: vec3<f32>,
}

fn no_incoming_light() -> IncomingLight {
    return IncomingLight(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), NO_LIGHT, vec3(0.0));
}

/// Light from a listed light to a point. Only lights with an extent use `square`.
fn incoming_light(light: ListLight, at: vec3<f32>, square: vec2<f32>) -> IncomingLight {
    switch light.kind {
        case SUN: { return incoming_from_sun(light); }
        case POINT: { return incoming_from_point(light, at); }
        case SPOT: { return incoming_from_spot(light, at); }
        case SPHERE: { return incoming_from_sphere(light, at, square); }
        case DISK: { return incoming_from_disk(light, at, square); }
        default: { return no_incoming_light(); }
    }
}

/// Density of `incoming_light` for a unit direction that hits the light.
fn light_density(light: ListLight, at: vec3<f32>, direction: vec3<f32>) -> f32 {
    switch light.kind {
        case SPHERE: { return sphere_density(light, at); }
        case DISK: { return disk_density(light, at, direction); }
        case SUN, POINT, SPOT, default: { return 0.0; }
    }
}

// part lights
// The listed lights of the scene.

@group(3) @binding(0) var<storage, read> lights: array<ListLight>;

// part sampled
// Sampling of local listed lights.
// use shared/light/list/lights
// use shared/light/sampler
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
    return light_probability(leaf, receiver) * light_density(light, receiver.position, direction);
}

// part hit
// Shape lights as rays hit them: sides that do not emit are black.
// use shared/light/sphere/hit
// use shared/light/disk/hit

/// Closest intersection with a shape light, and whether its side emits.
struct Crossing {
    /// Above `FAR` for a miss.
    t: f32,
    emits: bool,
}

const NO_CROSSING: f32 = 3.2e38;

fn shape_light_crossing(light: ListLight, ray: Ray) -> Crossing {
    switch light.kind {
        case SPHERE: { return sphere_crossing(light, ray); }
        case DISK: { return disk_crossing(light, ray); }
        case SUN, POINT, SPOT, default: { return Crossing(NO_CROSSING, false); }
    }
}

/// Unit normal of a shape light at one of its points.
fn normal_of_light(light: ListLight, point: vec3<f32>) -> vec3<f32> {
    switch light.kind {
        case SPHERE: { return normalize(point - light.position); }
        case DISK: { return light.direction; }
        case SUN, POINT, SPOT, default: { return vec3(0.0, 0.0, 1.0); }
    }
}
