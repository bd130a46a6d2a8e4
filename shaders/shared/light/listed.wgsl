// Lights of the list that have a place, chosen one at a time.
// use shared/light/lights
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
