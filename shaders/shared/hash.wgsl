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
