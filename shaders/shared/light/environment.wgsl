// The environment: `?sky` is its radiance, `?skylight` samples it.

// choice sky/black
// A black background.

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return vec3(0.0);
}

// choice sky/constant
// Constant radiance from all directions.
// use shared/picture

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return picture.ambient;
}

// choice sky/image
// An environment map in latitude-longitude form; twin of crates/renderer/src/light/environment.rs.
//
// The center of the image is -z, its top edge +y. Image positions err by about 2^-22 of the width and height.
// use shared/numbers
// use shared/angle

struct SkyImage {
    /// Factor of all texels, linear RGB.
    scale: vec3<f32>,
    width: u32,
    height: u32,
    /// Rotation around +y as a fraction of a turn, counter-clockwise, in 0..1.
    turn: f32,
}

@group(3) @binding(1) var<uniform> sky_image: SkyImage;
/// Three floats per texel, row by row from the zenith.
@group(3) @binding(2) var<storage, read> sky_texels: array<f32>;

/// Radiance from a direction of any length, bilinear between texel centers.
fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    let size = vec2(sky_image.width, sky_image.height);
    let texels = sky_position(direction) * vec2<f32>(size) - 0.5;
    let first = floor(texels);
    let weight = texels - first;
    let corner = vec2<i32>(first);
    // The image wraps around horizontally and is clamped vertically.
    let left = u32(select(corner.x, i32(size.x) - 1, corner.x < 0)) % size.x;
    let right = u32(corner.x + 1) % size.x;
    let top = u32(clamp(corner.y, 0, i32(size.y) - 1));
    let bottom = u32(clamp(corner.y + 1, 0, i32(size.y) - 1));
    let upper = mix(sky_texel(top, left), sky_texel(top, right), weight.x);
    let lower = mix(sky_texel(bottom, left), sky_texel(bottom, right), weight.x);
    return bounded(mix(upper, lower, weight.y) * sky_image.scale);
}

fn sky_texel(row: u32, column: u32) -> vec3<f32> {
    let first = 3u * (row * sky_image.width + column);
    return vec3(sky_texels[first], sky_texels[first + 1u], sky_texels[first + 2u]);
}

/// Image position of a direction: horizontal in 0..=1 from the left, vertical in 0..=1 from the top.
fn sky_position(direction: vec3<f32>) -> vec2<f32> {
    let most = max(max(abs(direction.x), abs(direction.y)), max(abs(direction.z), 1e-30));
    let d = direction / most;
    let across = angle_of(d.x, -d.z) / TAU + 0.5 + sky_image.turn;
    return vec2(across - floor(across), angle_of(length(d.xz), d.y) / PI);
}

/// Unit direction of a horizontal image position and a cosine to +y.
fn sky_direction(across: f32, cosine: f32) -> vec3<f32> {
    let turned = circle(across - sky_image.turn - 0.5);
    let sine = sqrt(max((1.0 - cosine) * (1.0 + cosine), 0.0));
    return vec3(sine * turned.y, cosine, -sine * turned.x);
}

// choice skylight/black
// No sky to sample.
// use shared/light/sampler

fn sample_sky(receiver: Receiver, square: vec2<f32>) -> LightSample {
    return no_light();
}

fn sky_density(receiver: Receiver, direction: vec3<f32>) -> f32 {
    return 0.0;
}

// choice skylight/cosine
// Cosine sampling around the shading normal, for a constant sky.
// use shared/sampling
// use shared/light/sampler
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

// choice skylight/image
// Samples the environment map by texel brightness times solid angle, uniform within a texel; twin of `SkySampler`.
//
// Cumulative sums are stored in f32, normalized. The probability of a texel is the difference of two neighbors, which is exact,
// so the reported density is the sampled one. Rounding can take up to 2^-24 of a row from a texel; BSDF sampling covers that
// part.
// use shared/light/environment/sky/image
// use shared/light/sampler
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
