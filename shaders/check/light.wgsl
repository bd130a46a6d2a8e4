// Samples the lights of a scene and evaluates densities, to compare with the CPU.
// use shared/invocation/index
// use shared/light/sampler
// use ?sky

struct Query {
    position: vec3<f32>,
    choice: f32,
    normal: vec3<f32>,
    transmits: u32,
    square: vec2<f32>,
    /// What the direction hits: 0 the sky, 1 a shape light, 2 a triangle. Then its number or instance, and its primitive.
    kind: u32,
    number: u32,
    to_light: vec3<f32>,
    primitive: u32,
    shading_normal: vec3<f32>,
}

struct Answer {
    to_light: vec3<f32>,
    density: f32,
    radiance: vec3<f32>,
    shadow_ray: u32,
    position: vec3<f32>,
    shape_light: u32,
    is_emission: u32,
    /// Density of the direction of the query.
    density_there: f32,
}

@group(0) @binding(0) var<storage, read> queries: array<Query>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&answers) {
        return;
    }
    let q = queries[index];
    let receiver = Receiver(q.position, q.transmits != 0u, q.normal, q.shading_normal);
    let light = sample_light(receiver, q.choice, q.square);
    var density = sky_light_density(receiver, q.to_light);
    if q.kind == 1u {
        density = shape_light_density(receiver, q.number, q.to_light);
    } else if q.kind == 2u {
        density = surface_light_density(receiver, q.number, q.primitive, q.to_light);
    }
    let found = light.incoming;
    answers[index] = Answer(
        found.to_light, found.density, found.radiance, found.shadow_ray, found.position, light.shape_light, u32(light.is_emission), density,
    );
}
