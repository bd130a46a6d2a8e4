// Random numbers as a pure function of pixel, sample, dimension and seed: the same bits as the CPU's.
//
// Numbers lie in [0, 1) and are multiples of 2^-24, exact in f32. `?pattern` spreads the samples of a pixel: it gives `pair`, a
// point of the unit square, and `single`, a number of its own; each use along a path has its own dimension.
// use shared/hash
// use ?pattern

struct Sampler {
    seed: u32,
    /// Cells of a grid along x and along y, one for each sample.
    columns: u32,
    rows: u32,
    /// Their product.
    n_samples: u32,
}

/// Random bits, the same whatever the pattern.
fn bits(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> u32 {
    return mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 10u) ^ sample);
}

/// What tells the uses of the random numbers apart.
fn key(sampler: Sampler, pixel: u32, dimension: u32) -> u32 {
    return mix_bits(mix_bits(mix_bits(sampler.seed) ^ pixel) ^ dimension);
}
