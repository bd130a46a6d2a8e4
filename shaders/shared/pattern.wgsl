// choice random
// Each sample by itself.

fn pair(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> vec2<f32> {
    let x = mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 1u) ^ sample);
    let y = mix_bits(x ^ 2u);
    return vec2(unit_interval(x >> 8u), unit_interval(y >> 8u));
}

fn single(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> f32 {
    return unit_interval(mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 6u) ^ sample) >> 8u);
}

// choice sobol
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
    return reverseBits(laine_karras(reverseBits(index), seed));
}

/// The coordinate whose bits, the greatest lowest, are `mirrored`, after scrambling.
fn scrambled(mirrored: u32, seed: u32) -> u32 {
    return reverseBits(laine_karras(mirrored, seed));
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
fn laine_karras(bits: u32, seed: u32) -> u32 {
    var x = bits ^ (bits * 0x3d20adeau);
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}

// choice stratified
// One sample in each cell of a grid, and in each of n columns and rows, after Kensler 2013. At most 2^20 samples a pixel.

fn pair(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> vec2<f32> {
    // The permutations are of the pixel and dimension, the jitter of the sample too.
    let use_key = key(sampler, pixel, dimension);
    let jitter_x = mix_bits(mix_bits(use_key ^ 1u) ^ sample);
    let jitter_y = mix_bits(jitter_x ^ 2u);
    let n = sampler.n_samples;
    let cell = permuted(sample % n, n, mix_bits(use_key ^ 3u));
    let column = cell % sampler.columns;
    let row = cell / sampler.columns;
    // Inside its cell a sample takes the column of its row and the row of its column.
    let x_stratum = column * sampler.rows + permuted(row, sampler.rows, mix_bits(use_key ^ 4u));
    let y_stratum = row * sampler.columns + permuted(column, sampler.columns, mix_bits(use_key ^ 5u));
    return vec2(jittered(x_stratum, n, jitter_x), jittered(y_stratum, n, jitter_y));
}

fn single(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> f32 {
    let use_key = key(sampler, pixel, dimension);
    let n = sampler.n_samples;
    return jittered(permuted(sample % n, n, mix_bits(use_key ^ 7u)), n, mix_bits(mix_bits(use_key ^ 6u) ^ sample));
}

/// A number of stratum `k` of `n`: a multiple `x` of 2^-24 with `k/n <= x < (k + 1)/n`, exactly.
fn jittered(k: u32, n: u32, random: u32) -> f32 {
    let low = first_step(k, n);
    let high = first_step(k + 1u, n);
    return unit_interval(min(low + high_product(random, high - low), (1u << 24u) - 1u));
}

/// The least number of steps of 2^-24 that make `k/n` or more, for `k <= n <= 2^20`: two digits of 12 bits, by hand.
fn first_step(k: u32, n: u32) -> u32 {
    if k == n {
        return 1u << 24u;
    }
    let after_first = (k << 12u) % n;
    let steps = (((k << 12u) / n) << 12u) + (after_first << 12u) / n;
    return steps + u32((after_first << 12u) % n > 0u);
}

/// The upper 32 bits of a product.
fn high_product(a: u32, b: u32) -> u32 {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let first = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let second = (a & 0xffffu) * (b >> 16u) + (first & 0xffffu);
    return (a >> 16u) * (b >> 16u) + (first >> 16u) + (second >> 16u);
}

/// Image of `i < n` under a permutation of `0..n` chosen by `permutation`.
///
/// Rounds that are each a bijection of `0..2^k` for the least `2^k >= n`; values outside `0..n` walk on along their cycle until
/// they are inside, which takes fewer than two turns on average. A rotation at the end makes every place equally likely.
fn permuted(i: u32, n: u32, permutation: u32) -> u32 {
    let n_bits = 32u - countLeadingZeros(n - 1u);
    let mask = (1u << n_bits) - 1u;
    let shift = max((n_bits + 1u) / 2u, 1u);
    let first = mix_bits(permutation);
    let second = mix_bits(permutation ^ 1u);
    let third = mix_bits(permutation ^ 2u);
    var place = i;
    loop {
        place = permutation_round(place, first, mask, shift);
        place = permutation_round(place, second, mask, shift);
        place = permutation_round(place, third, mask, shift);
        if place < n {
            break;
        }
    }
    return (place + high_product(mix_bits(permutation ^ 3u), n)) % n;
}

/// Sum and odd factor modulo 2^k, then the high half folded onto the low: all invertible.
fn permutation_round(place: u32, round: u32, mask: u32, shift: u32) -> u32 {
    let mixed = ((place + round) * ((round >> 16u) | 1u)) & mask;
    return mixed ^ (mixed >> shift);
}
