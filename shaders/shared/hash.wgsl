// 32-bit hashes and numbers of the unit interval.

/// A bijection in which every input bit flips about half of the output bits: two rounds of xor-shift and odd multiplication
/// with constants found by Wellons (2018).
fn mix_bits(bits: u32) -> u32 {
    var x = bits + 0x9e3779b9u;
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

/// `steps` times 2^-24, for fewer than 2^24 steps.
fn unit_interval(steps: u32) -> f32 {
    return f32(steps) * 0x1p-24f;
}

// part ray_key
// A key per ray, for stochastic alpha.

var<private> ray_key: u32;

/// Sampler dimension of ray keys, separate from those that are counted up.
const ALPHA_DIMENSION: u32 = 0xfffffffdu;

/// The key of ray `number` derived from `key`. Derived keys form a tree.
fn derived_key(key: u32, number: u32) -> u32 {
    return mix_bits(key ^ number);
}
