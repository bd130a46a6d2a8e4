// Points of a scrambled (0,2)-sequence in base 2, after Burley 2020: bits flip by a hash in which they reach only higher ones.

fn pair(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> vec2<f32> {
    let use_key = key(sampler, pixel, dimension);
    let index = shuffled(sample, mix_bits(use_key ^ 3u));
    let x = scrambled(index, mix_bits(use_key ^ 4u));
    let y = scrambled(second_coordinate(index), mix_bits(use_key ^ 5u));
    return vec2(unit_interval(x >> 8u), unit_interval(y >> 8u));
}

fn single(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> f32 {
    let use_key = key(sampler, pixel, dimension);
    return unit_interval(scrambled(shuffled(sample, mix_bits(use_key ^ 8u)), mix_bits(use_key ^ 9u)) >> 8u);
}

/// The number that sample `index` is given: any aligned `2^m` of them are turned into an aligned `2^m`.
fn shuffled(index: u32, seed: u32) -> u32 {
    return reverseBits(upwards(reverseBits(index), seed));
}

/// The coordinate whose bits, the greatest lowest, are `mirrored`, after scrambling.
fn scrambled(mirrored: u32, seed: u32) -> u32 {
    return reverseBits(upwards(mirrored, seed));
}

/// The second coordinate of point `index` before scrambling, mirrored; the first is `index` itself.
fn second_coordinate(index: u32) -> u32 {
    var y = index;
    y ^= (y >> 1u) & 0x55555555u;
    y ^= (y >> 2u) & 0x33333333u;
    y ^= (y >> 4u) & 0x0f0f0f0fu;
    y ^= (y >> 8u) & 0x00ff00ffu;
    return y ^ ((y >> 16u) & 0x0000ffffu);
}

/// A bijection in which a bit changes by chance with those below it, and with none above (Laine and Karras 2011, with the
/// constants of Vegdahl 2021).
fn upwards(bits: u32, seed: u32) -> u32 {
    var x = bits ^ (bits * 0x3d20adeau);
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}
