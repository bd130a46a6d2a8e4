// Each sample by itself.

fn pair(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> vec2<f32> {
    let x = mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 1u) ^ sample);
    let y = mix_bits(x ^ 2u);
    return vec2(unit_interval(x >> 8u), unit_interval(y >> 8u));
}

fn single(sampler: Sampler, pixel: u32, sample: u32, dimension: u32) -> f32 {
    return unit_interval(mix_bits(mix_bits(key(sampler, pixel, dimension) ^ 6u) ^ sample) >> 8u);
}
