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

// part lights
// The lights of the scene's list, in its order.

@group(3) @binding(0) var<storage, read> lights: array<ListLight>;

// part sampled
// Lights of the list that have a place, chosen one at a time.
// use shared/light/list/lights
// use shared/light/sample
// use shared/light/tree

/// Leaf of each light of the list in the tree; `NO_LEAF` for those that are not in it.
@group(3) @binding(7) var<storage, read> light_leaves: array<u32>;

const NO_LEAF: u32 = 0xffffffffu;

/// Light from a light of the list.
fn sample_listed(number: u32, at: vec3<f32>, square: vec2<f32>) -> LightSample {
    return LightSample(incoming_light(lights[number], at, square), number, false);
}

/// Density of a unit direction that meets a body of the list, the choice of the body included.
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
