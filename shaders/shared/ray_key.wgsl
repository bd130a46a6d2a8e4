// What tells rays apart for surfaces that stop some and let others pass.

// use shared/hash
var<private> ray_key: u32;

/// Dimension that numbers rays, apart from those that are counted up.
const PASSAGE: u32 = 0xfffffffdu;

/// The key of ray `number` of those that `key` stands for; numbers of numbers make a tree.
fn derived_key(key: u32, number: u32) -> u32 {
    return mix_bits(key ^ number);
}
