// Random numbers as a pure function of pixel, sample, dimension and seed, with the same bits as on the CPU.
//
// Numbers are multiples of 2^-24 in [0, 1), exact in f32. `?pattern` distributes the samples of a pixel: `pair` is a point of
// the unit square, `single` a number. Each use along a path has its own dimension.
// use shared/hash
// use ?pattern

struct Sampler {
    seed: u32,
    /// Grid of one cell per sample.
    columns: u32,
    rows: u32,
    /// Product of the two.
    n_samples: u32,
}

/// Random bits, independent of the pattern.
fn bits(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> u32 {
    return mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 10u) ^ sample);
}

/// Distinguishes the uses of the random numbers.
fn key(sampler: Sampler, pixel: u32, dimension: u32) -> u32 {
    return mix_bits(mix_bits(mix_bits(sampler.seed) ^ pixel) ^ dimension);
}
