// Evaluates and samples the BSDF of hair, to compare with the CPU.
// use shared/invocation/index
// use shared/hair

struct Query {
    absorption: vec3<f32>,
    roughness: f32,
    roughness_around: f32,
    tilt_rad: f32,
    ior: f32,
    choice: f32,
    outgoing: vec3<f32>,
    incident: vec3<f32>,
    square: vec2<f32>,
}

struct Answer {
    value: vec3<f32>,
    density: f32,
    incident: vec3<f32>,
    sampled_density: f32,
    weight: vec3<f32>,
    /// 1: found, 4: transmitted.
    flags: u32,
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
    fiber = Fiber(q.absorption, q.roughness, q.roughness_around, q.tilt_rad, q.ior, true);
    let evaluated = evaluate_hair(q.outgoing, q.incident);
    let sampled = sample_hair(q.outgoing, q.square, q.choice);
    let flags = select(0u, 1u, sampled.is_found) | select(0u, 4u, sampled.is_transmitted);
    answers[index] = Answer(evaluated.value, evaluated.density, sampled.incident, sampled.density, sampled.weight, flags);
}
