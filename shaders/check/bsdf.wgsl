// Evaluates and samples the BSDF of one material, to compare with the CPU.
// use shared/invocation/index
// use ?bsdf

struct Query {
    base_color: vec3<f32>,
    metallic: f32,
    roughness: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    outgoing: vec3<f32>,
    choice: f32,
    incident: vec3<f32>,
    /// 1: thin-walled, 2: inside.
    flags: u32,
    square: vec2<f32>,
}

struct Answer {
    value: vec3<f32>,
    density: f32,
    incident: vec3<f32>,
    sampled_density: f32,
    weight: vec3<f32>,
    /// 1: found, 2: delta, 4: transmitted, 8: only delta lobes.
    flags: u32,
    compression: f32,
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
    let bsdf = Bsdf(
        q.base_color, q.metallic, q.roughness, q.specular, q.transmission, q.ior, (q.flags & 1u) != 0u, (q.flags & 2u) != 0u,
    );
    let evaluated = evaluate_bsdf(bsdf, q.outgoing, q.incident);
    let sampled = sample_bsdf(bsdf, q.outgoing, q.square, q.choice);
    let flags = select(0u, 1u, sampled.is_found) | select(0u, 2u, sampled.is_delta)
        | select(0u, 4u, sampled.is_transmitted) | select(0u, 8u, is_delta_only(bsdf));
    answers[index] = Answer(
        evaluated.value, evaluated.density, sampled.incident, sampled.density, sampled.weight, flags, compression_of(bsdf),
    );
}
