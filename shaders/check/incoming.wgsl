// Evaluates `incoming_light` and the densities of shape lights, to compare with the CPU.
// use shared/invocation/index
// use shared/light/list

struct Query {
    at: vec3<f32>,
    light: u32,
    square: vec2<f32>,
}

struct Answer {
    incoming: IncomingLight,
    /// Density of the sampled direction.
    density: f32,
}

@group(0) @binding(0) var<storage, read> lights: array<ListLight>;
@group(0) @binding(1) var<storage, read> queries: array<Query>;
@group(0) @binding(2) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&answers) {
        return;
    }
    let query = queries[index];
    let light = lights[query.light];
    let incoming = incoming_light(light, query.at, query.square);
    answers[index] = Answer(incoming, light_density(light, query.at, incoming.to_light));
}
