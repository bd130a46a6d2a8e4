// Evaluates the sampler, to compare with the CPU.
// use shared/invocation/index
// use shared/sampler

struct Query {
    pixel: u32,
    sample: u32,
    dimension: u32,
    seed: u32,
    columns: u32,
    rows: u32,
}

struct Answer {
    pair: vec2<f32>,
    single: f32,
    bits: u32,
}

@group(0) @binding(0) var<storage, read> queries: array<Query>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&queries) {
        return;
    }
    let query = queries[index];
    let sampler = Sampler(query.seed, query.columns, query.rows, query.columns * query.rows);
    answers[index] = Answer(
        pair(sampler, query.pixel, query.sample, query.dimension),
        single(sampler, query.pixel, query.sample, query.dimension),
        bits(sampler, query.pixel, query.sample, query.dimension),
    );
}
