// Hashes of 32 bits, and numbers of the unit interval.

/// A bijection in which every input bit flips about half of the output bits; two rounds of xor-shift and odd multiplication
/// with the constants that Wellons found by search in 2018.
fn mix_bits(bits: u32) -> u32 {
    var x = bits + 0x9e3779b9u;
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

/// The multiple of 2^-24 with this number of steps, fewer than 2^24.
fn unit_interval(steps: u32) -> f32 {
    return f32(steps) * 0x1p-24f;
}

// part ray_key
// What tells rays apart for surfaces that stop some and let others pass.

var<private> ray_key: u32;

/// Dimension that numbers rays, apart from those that are counted up.
const ALPHA_DIMENSION: u32 = 0xfffffffdu;

/// The key of ray `number` of those that `key` stands for; numbers of numbers make a tree.
fn derived_key(key: u32, number: u32) -> u32 {
    return mix_bits(key ^ number);
}
