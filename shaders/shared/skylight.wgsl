// choice black
// No sky to sample.
// use shared/light/sample

fn sample_sky(receiver: Receiver, square: vec2<f32>) -> LightSample {
    return no_light();
}

fn sky_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    return 0.0;
}

// choice cosine
// Cosine sampling around the shading normal, for a constant sky.
// use shared/sampling
// use shared/light/sample
// use ?sky

/// Samples the sky.
fn sample_sky(receiver: Receiver, square: vec2<f32>) -> LightSample {
    let local = cosine_hemisphere(square);
    let to_light = basis_about(receiver.shading_normal) * local;
    let density = cosine_density(local.z);
    let radiance = bounded(sky_radiance(to_light) * quotient(1.0, density));
    return LightSample(IncomingLight(to_light, density, radiance, INFINITE, vec3(0.0)), NO_SHAPE_LIGHT, false);
}

/// Density of `sample_sky` for a unit direction.
fn sky_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    return cosine_density(dot(receiver.shading_normal, direction));
}

// choice image
// Samples the environment map by texel brightness times solid angle, uniform within a texel; twin of `SkySampler`.
//
// Cumulative sums are stored in f32, normalized. The probability of a texel is the difference of two neighbors, which is exact,
// so the reported density is the sampled one. Rounding can take up to 2^-24 of a row from a texel; BSDF sampling covers that
// part.
// use shared/sky/image
// use shared/light/sample
// use shared/invocation/iterations

struct SkyRow {
    /// Cumulative sum of the rows above.
    sum: f32,
    /// Cosine of the upper edge to +y.
    cosine: f32,
    /// Texels of this row per steradian.
    per_steradian: f32,
}

/// One more than the image has.
@group(3) @binding(3) var<storage, read> sky_rows: array<SkyRow>;
/// Cumulative sum left of each column edge, one more per row than it has texels.
@group(3) @binding(8) var<storage, read> sky_sums: array<f32>;

/// Samples the sky.
fn sample_sky(receiver: Receiver, square: vec2<f32>) -> LightSample {
    let row = sky_interval(true, 0u, sky_image.height, square.y);
    let first = row * (sky_image.width + 1u);
    let column = sky_interval(false, first, sky_image.width, square.x);
    let down = share_between(sky_rows[row].sum, sky_rows[row + 1u].sum, square.y);
    let within = share_between(sky_sums[first + column], sky_sums[first + column + 1u], square.x);
    let across = (f32(column) + within) / f32(sky_image.width);
    let to_light = sky_direction(across, mix(sky_rows[row].cosine, sky_rows[row + 1u].cosine, down));
    let density = sky_density_at(row, column);
    let radiance = bounded(sky_radiance(to_light) * quotient(1.0, density));
    return LightSample(IncomingLight(to_light, density, radiance, INFINITE, vec3(0.0)), NO_SHAPE_LIGHT, false);
}

/// Density of `sample_sky` for a unit direction.
fn sky_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    let size = vec2(sky_image.width, sky_image.height);
    let texel = min(vec2<u32>(sky_position(direction) * vec2<f32>(size)), size - 1u);
    return sky_density_at(texel.y, texel.x);
}

fn sky_density_at(row: u32, column: u32) -> f32 {
    let first = row * (sky_image.width + 1u) + column;
    let row_probability = sky_rows[row + 1u].sum - sky_rows[row].sum;
    return min(row_probability * (sky_sums[first + 1u] - sky_sums[first]) * sky_rows[row].per_steradian, MAX_QUOTIENT);
}

/// Position of a number within an interval, as a fraction.
fn share_between(low: f32, high: f32, number: f32) -> f32 {
    return clamp(quotient(number - low, high - low), 0.0, 1.0);
}

/// A cumulative sum: of rows, or of the columns whose sums start at `start`.
fn sky_sum(is_row: bool, start: u32, index: u32) -> f32 {
    if is_row {
        return sky_rows[index].sum;
    }
    return sky_sums[start + index];
}

/// Which of `n` intervals of a cumulative sum contains a number below 1. Empty intervals are never found.
fn sky_interval(is_row: bool, start: u32, n: u32, number: f32) -> u32 {
    var first = 1u;
    var last = n;
    loop {
        iterations += 1u;
        if first >= last {
            break;
        }
        let middle = (first + last) / 2u;
        if sky_sum(is_row, start, middle) <= number {
            first = middle + 1u;
        } else {
            last = middle;
        }
    }
    return first - 1u;
}
