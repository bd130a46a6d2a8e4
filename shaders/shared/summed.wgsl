// Numbers of samples as f64, which are computed in integers: what `render/sum` adds, with the bits of sums on the host.
//
// `?summed` is what is summed: light, its parts, or what camera rays hit first.
// use shared/exact/number

/// Bits of infinity; those of NaN are greater.
const NOT_FINITE: u32 = 0x7f800000u;

/// The nearest f64 to the sum of two.
fn f64_sum(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return f64_bits(as_f64(added(from_f64(a), from_f64(b))));
}

/// The f64 of a number of at most 53 bits: its sums and squares of f32 are neither subnormal nor infinite.
fn f64_bits(a: Number) -> vec2<u32> {
    if a.high == 0u {
        return vec2(0u);
    }
    // The mantissa without its top bit, whose exponent is 63 above that of the lowest.
    let low = (a.high << 21u) | (a.low >> 11u);
    let high = (a.high >> 11u) & 0xfffffu;
    return vec2(low, (u32(a.is_negative) << 31u) | (u32(a.exponent + 63 + 1023) << 20u) | high);
}

/// Whether all three are finite, by their bits.
fn are_finite(bits: vec3<u32>) -> bool {
    let magnitudes = bits & vec3(0x7fffffffu);
    return max(magnitudes.x, max(magnitudes.y, magnitudes.z)) < NOT_FINITE;
}

// choice summed/light
// The light of samples.
// use shared/summed
// use shared/picture
// use ?filter

/// The samples of a pixel.
struct SampleSum {
    /// Linear RGB, minus that of samples with negative weight, and the squares: an f64 each, the lower half first.
    sum: array<vec2<u32>, 3>,
    sum_of_squares: array<vec2<u32>, 3>,
    /// Samples in the sums with negative weight, and samples that are not finite.
    n_negative: u32,
    n_dropped: u32,
    /// Rays traced, the lower half first.
    n_rays: vec2<u32>,
}

/// As bits, which loads do not change: linear RGB and the number of rays, -1 for a sample that was not finished.
@group(1) @binding(4) var<storage, read> samples: array<vec4<u32>>;

/// Whether no kernel finished a sample.
fn is_unfinished(at: u32) -> bool {
    return samples[at].w >= 0x80000000u;
}

/// The sum of two pixels.
fn plus(a: SampleSum, b: SampleSum) -> SampleSum {
    var c: SampleSum;
    for (var k = 0u; k < 3u; k += 1u) {
        c.sum[k] = f64_sum(a.sum[k], b.sum[k]);
        c.sum_of_squares[k] = f64_sum(a.sum_of_squares[k], b.sum_of_squares[k]);
    }
    c.n_negative = a.n_negative + b.n_negative;
    c.n_dropped = a.n_dropped + b.n_dropped;
    let low = a.n_rays.x + b.n_rays.x;
    c.n_rays = vec2(low, a.n_rays.y + b.n_rays.y + u32(low < a.n_rays.x));
    return c;
}

/// The sum of a sample alone.
fn sum_of(one: PixelSample, at: u32) -> SampleSum {
    let sample = samples[at];
    var c: SampleSum;
    c.n_rays = vec2(u32(bitcast<f32>(sample.w)), 0u);
    if !are_finite(sample.xyz) {
        c.n_dropped = 1u;
        return c;
    }
    let is_negative = filter_weight(square(one, PIXEL_POSITION)) < 0.0;
    for (var k = 0u; k < 3u; k += 1u) {
        var x = from_f32(bitcast<f32>(sample[k]));
        c.sum_of_squares[k] = f64_bits(multiplied(x, x));
        x.is_negative = x.is_negative != is_negative;
        c.sum[k] = f64_bits(x);
    }
    c.n_negative = u32(is_negative);
    return c;
}

// choice summed/guide
// What the camera rays of samples hit first: `Guide` of `render/guide`.
// use shared/summed
// use shared/picture
// use shared/ray

/// The samples of a pixel.
struct SampleSum {
    /// The numbers of three rows of `guides`: an f64 each, the lower half first.
    sum: array<vec2<u32>, 12>,
    /// Samples that hit something.
    n_hits: u32,
    /// Of the first sample that hits a triangle; `NONE` without one.
    instance: u32,
    primitive: u32,
    padding: u32,
}

/// As bits, which loads do not change: normal and depth, shading normal and boxes, albedo and triangles, primitive and instance of each
/// sample.
@group(1) @binding(11) var<storage, read> guides: array<array<vec4<u32>, 4>>;

/// Whether the traversal of a sample was cut short.
fn is_unfinished(at: u32) -> bool {
    return guides[at][3].x == INCOMPLETE;
}

/// The sum of two pixels.
fn plus(a: SampleSum, b: SampleSum) -> SampleSum {
    var c: SampleSum;
    for (var k = 0u; k < 12u; k += 1u) {
        c.sum[k] = f64_sum(a.sum[k], b.sum[k]);
    }
    c.n_hits = a.n_hits + b.n_hits;
    let is_of_a = a.instance != NONE;
    c.instance = select(b.instance, a.instance, is_of_a);
    c.primitive = select(b.primitive, a.primitive, is_of_a);
    return c;
}

/// The sum of a sample alone. Numbers that are not finite count as zero.
fn sum_of(one: PixelSample, at: u32) -> SampleSum {
    let guide = guides[at];
    var c: SampleSum;
    for (var k = 0u; k < 12u; k += 1u) {
        let bits = guide[k / 4u][k % 4u];
        c.sum[k] = f64_bits(from_f32(bitcast<f32>(select(0u, bits, are_finite(vec3(bits))))));
    }
    c.primitive = guide[3].x;
    c.instance = guide[3].y;
    c.n_hits = u32(c.primitive != NONE);
    return c;
}

// choice summed/components
// The light of samples by how many surfaces scattered it: `components` of `shared/camera/components`.
// use shared/summed/parts

/// Numbers of a sample.
const N_NUMBERS: u32 = 9u;

/// As bits, which loads do not change: those of each sample.
@group(1) @binding(5) var<storage, read> components: array<array<u32, 9>>;

/// The bits of a number of a sample.
fn number_of(at: u32, k: u32) -> u32 {
    return components[at][k];
}

// choice summed/first_light
// The light at the first surface of samples: `first_light` of `shared/camera/first_light`.
// use shared/summed/parts

/// Numbers of a sample.
const N_NUMBERS: u32 = 12u;

/// As bits, which loads do not change: those of each sample.
@group(1) @binding(13) var<storage, read> first_light: array<array<u32, 12>>;

/// The bits of a number of a sample.
fn number_of(at: u32, k: u32) -> u32 {
    return first_light[at][k];
}

// part parts
// Parts of the light, with the sign of the weight of their sample.
// use shared/summed
// use shared/picture
// use ?filter

/// The samples of a pixel.
struct SampleSum {
    /// An f64 each, the lower half first.
    sum: array<vec2<u32>, N_NUMBERS>,
}

/// The light of a sample says whether it was finished.
fn is_unfinished(at: u32) -> bool {
    return false;
}

/// The sum of two pixels.
fn plus(a: SampleSum, b: SampleSum) -> SampleSum {
    var c: SampleSum;
    for (var k = 0u; k < N_NUMBERS; k += 1u) {
        c.sum[k] = f64_sum(a.sum[k], b.sum[k]);
    }
    return c;
}

/// The sum of a sample alone. One with a number that is not finite counts as zero.
fn sum_of(one: PixelSample, at: u32) -> SampleSum {
    let is_negative = filter_weight(square(one, PIXEL_POSITION)) < 0.0;
    var c: SampleSum;
    for (var k = 0u; k < N_NUMBERS; k += 1u) {
        let bits = number_of(at, k);
        if !are_finite(vec3(bits)) {
            return SampleSum();
        }
        var x = from_f32(bitcast<f32>(bits));
        x.is_negative = x.is_negative != is_negative;
        c.sum[k] = f64_bits(x);
    }
    return c;
}
