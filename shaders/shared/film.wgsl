// What is kept of samples: `keep` stores a sample, or adds it to the others of its pixel. All invocations of a work-group call it.
// use shared/picture
// use ?traverse

// choice samples
// Stores every sample; the host sums them in f64.

/// Linear RGB radiance of each sample, and the number of rays traced, -1 if one was incomplete. 64 pixels per work-group, row
/// by row.
@group(1) @binding(4) var<storage, read_write> samples: array<vec4<f32>>;

fn keep(group: u32, local: u32, one: PixelSample, radiance: vec3<f32>, n_rays: u32) {
    if one.is_inside {
        samples[64u * group + local] = vec4(radiance, select(f32(n_rays), -1.0, is_incomplete));
    }
}

// choice sums
// Sums the samples of a block in work-group memory, by halves: the order in which the film sums blocks. The host sums blocks in f64.
//
// A sum of 64 samples has six roundings on the way of each sample, so its error is at most `gamma(6)` of the sum of absolute values,
// for roundings of 2^-23 in any direction (Higham 2002, section 4.2). Squared deviations from the mean are merged after Chan, Golub, LeVeque 1983: unlike the sum of squares, they
// lose no digits where samples hardly differ.
// use shared/camera
// use ?filter

/// Bits of 2^56. Squares of 64 smaller numbers sum to less than 2^120.
const MAX_SUMMED: u32 = 0x5b800000u;
/// Bits of infinity; those of NaN are greater.
const NOT_FINITE: u32 = 0x7f800000u;

/// The samples of a pixel in a block.
struct BlockSum {
    /// Sum of linear RGB, minus that of samples with negative weight.
    sum: array<f32, 3>,
    /// Number of rays traced.
    n_rays: u32,
    /// Sum of squared deviations from the mean.
    deviations: array<f32, 3>,
    /// Samples in the sum, those of them with negative weight, and samples that are not finite: eight bits each, from the lowest.
    counts: u32,
    /// A bit for each sample that the host must take, from the first: incomplete ones, and those too large to be squared.
    unfinished: array<u32, 2>,
}

/// One per pixel of a cell and block, row by row.
@group(1) @binding(4) var<storage, read_write> sums: array<BlockSum>;

/// Members of `BlockSum` for each invocation; the last has rays, counts, and bits of unfinished samples.
var<workgroup> lane_sums: array<vec3<f32>, 64>;
var<workgroup> lane_deviations: array<vec3<f32>, 64>;
var<workgroup> lane_counts: array<vec4<u32>, 64>;

fn keep(group: u32, local: u32, one: PixelSample, radiance: vec3<f32>, n_rays: u32) {
    let lane = local % slice.block;
    lane_sums[local] = vec3(0.0);
    lane_deviations[local] = vec3(0.0);
    lane_counts[local] = vec4(0u);
    // Integers: compilers may assume that a float is finite.
    let magnitudes = bitcast<vec3<u32>>(radiance) & vec3(0x7fffffffu);
    let greatest = max(max(magnitudes.x, magnitudes.y), magnitudes.z);
    if one.is_inside {
        if is_incomplete || (greatest > MAX_SUMMED && greatest < NOT_FINITE) {
            let bit = 1u << (lane % 32u);
            lane_counts[local] = vec4(0u, 0u, select(bit, 0u, lane >= 32u), select(0u, bit, lane >= 32u));
        } else if greatest >= NOT_FINITE {
            lane_counts[local] = vec4(n_rays, 1u << 16u, 0u, 0u);
        } else {
            let weight = filter_weight(square(one, PIXEL_POSITION));
            lane_sums[local] = weight * radiance;
            lane_counts[local] = vec4(n_rays, select(1u, 1u + (1u << 8u), weight < 0.0), 0u, 0u);
        }
    }
    for (var half = 1u; half < slice.block; half *= 2u) {
        workgroupBarrier();
        if lane % (2u * half) == 0u {
            add_lane(local, local + half);
        }
    }
    if one.is_inside && lane == 0u {
        let sum = lane_sums[local];
        let deviations = lane_deviations[local];
        let counts = lane_counts[local];
        sums[(64u * group + local) / slice.block] = BlockSum(
            array<f32, 3>(sum.x, sum.y, sum.z),
            counts.x,
            array<f32, 3>(deviations.x, deviations.y, deviations.z),
            counts.y,
            array<u32, 2>(counts.z, counts.w),
        );
    }
}

/// Adds the samples of invocation `b` to those of `a`.
fn add_lane(a: u32, b: u32) {
    let n_a = f32(lane_counts[a].y & 0xffu);
    let n_b = f32(lane_counts[b].y & 0xffu);
    let apart = lane_sums[b] / max(n_b, 1.0) - lane_sums[a] / max(n_a, 1.0);
    lane_deviations[a] += lane_deviations[b] + (n_a * n_b / max(n_a + n_b, 1.0)) * apart * apart;
    lane_sums[a] += lane_sums[b];
    lane_counts[a] += lane_counts[b];
}
