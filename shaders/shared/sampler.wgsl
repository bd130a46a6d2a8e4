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

// choice pattern/random
// Independent samples.

fn pair(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> vec2<f32> {
    let x = mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 1u) ^ sample);
    let y = mix_bits(x ^ 2u);
    return vec2(unit_interval(x >> 8u), unit_interval(y >> 8u));
}

fn single(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> f32 {
    return unit_interval(mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 6u) ^ sample) >> 8u);
}

// choice pattern/sobol
// A scrambled (0,2)-sequence in base 2 (Burley 2020).
// use shared/sampler/net

fn pair(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> vec2<f32> {
    let use_key = key(sampler, pixel, dimension);
    let index = shuffled(sample, mix_bits(use_key ^ 3u));
    let x = scrambled(index, mix_bits(use_key ^ 4u));
    let y = scrambled(second_coordinate(index), mix_bits(use_key ^ 5u));
    return vec2(unit_interval(x >> 8u), unit_interval(y >> 8u));
}

fn single(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> f32 {
    return unit_interval(net_single(sample, key(sampler, pixel, dimension)) >> 8u);
}

/// Reversed second coordinate of point `index` before scrambling; the first is `index` itself.
fn second_coordinate(index: u32) -> u32 {
    var y = index;
    y ^= (y >> 1u) & 0x55555555u;
    y ^= (y >> 2u) & 0x33333333u;
    y ^= (y >> 4u) & 0x0f0f0f0fu;
    y ^= (y >> 8u) & 0x00ff00ffu;
    return y ^ ((y >> 16u) & 0x0000ffffu);
}

// choice pattern/stratified
// Correlated multi-jittered samples: one sample in each cell of a grid, and in each of n columns and rows (Kensler 2013). At
// most 2^20 samples per pixel.

fn pair(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> vec2<f32> {
    // Permutations depend on pixel and dimension; the jitter also on the sample.
    let use_key = key(sampler, pixel, dimension);
    let jitter_x = mix_bits(mix_bits(use_key ^ 1u) ^ sample);
    let jitter_y = mix_bits(jitter_x ^ 2u);
    let n = sampler.n_samples;
    let cell = permuted(sample % n, n, mix_bits(use_key ^ 3u));
    let column = cell % sampler.columns;
    let row = cell / sampler.columns;
    // Within its cell a sample takes the column of its row and the row of its column.
    let x_stratum = column * sampler.rows + permuted(row, sampler.rows, mix_bits(use_key ^ 4u));
    let y_stratum = row * sampler.columns + permuted(column, sampler.columns, mix_bits(use_key ^ 5u));
    return vec2(jittered(x_stratum, n, jitter_x), jittered(y_stratum, n, jitter_y));
}

fn single(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> f32 {
    let use_key = key(sampler, pixel, dimension);
    let n = sampler.n_samples;
    return jittered(permuted(sample % n, n, mix_bits(use_key ^ 7u)), n, mix_bits(mix_bits(use_key ^ 6u) ^ sample));
}

/// A number in stratum `k` of `n`: a multiple `x` of 2^-24 with `k/n <= x < (k + 1)/n`, exactly.
fn jittered(k: u32, n: u32, random: u32) -> f32 {
    let low = first_step(k, n);
    let high = first_step(k + 1u, n);
    return unit_interval(min(low + high_product(random, high - low), (1u << 24u) - 1u));
}

/// The smallest multiple of 2^-24 that is at least `k/n`, for `k <= n <= 2^20`; long division with two digits of 12 bits.
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

/// Image of `i < n` under a permutation of `0..n` selected by `permutation`.
///
/// Each round is a bijection of `0..2^k` for the smallest `2^k >= n`. Values outside `0..n` follow their cycle until they are
/// inside, in fewer than two steps on average. A final rotation makes every position equally likely.
fn permuted(i: u32, n: u32, permutation: u32) -> u32 {
    let n_bits = 32u - countLeadingZeros(n - 1u);
    let mask = (1u << n_bits) - 1u;
    let shift = max((n_bits + 1u) / 2u, 1u);
    let first = mix_bits(permutation);
    let second = mix_bits(permutation ^ 1u);
    let third = mix_bits(permutation ^ 2u);
    var image = i;
    loop {
        image = permutation_round(image, first, mask, shift);
        image = permutation_round(image, second, mask, shift);
        image = permutation_round(image, third, mask, shift);
        if image < n {
            break;
        }
    }
    return (image + high_product(mix_bits(permutation ^ 3u), n)) % n;
}

/// Addition and multiplication by an odd factor modulo 2^k, then xor of the high half into the low half: all invertible.
fn permutation_round(value: u32, round: u32, mask: u32, shift: u32) -> u32 {
    let mixed = ((value + round) * ((round >> 16u) | 1u)) & mask;
    return mixed ^ (mixed >> shift);
}

// part net
// One coordinate of a scrambled and shuffled sequence in base 2.
// use shared/hash

/// Coordinate of a sample in the sequence of a key, in units of 2^-32.
fn net_single(sample: u32, key: u32) -> u32 {
    return scrambled(shuffled(sample, mix_bits(key ^ 8u)), mix_bits(key ^ 9u));
}

/// The position of sample `index` in the sequence. Maps each aligned run of `2^m` samples to an aligned run of `2^m`.
fn shuffled(index: u32, seed: u32) -> u32 {
    return reverseBits(laine_karras(reverseBits(index), seed));
}

/// The scrambled coordinate with these reversed bits.
fn scrambled(mirrored: u32, seed: u32) -> u32 {
    return reverseBits(laine_karras(mirrored, seed));
}

/// A bijection in which each bit depends only on itself and lower bits (Laine and Karras 2011, with the constants of Vegdahl
/// 2021).
fn laine_karras(bits: u32, seed: u32) -> u32 {
    var x = bits ^ (bits * 0x3d20adeau);
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}
