// choice black
// A black background.

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return vec3(0.0);
}

// choice constant
// Constant radiance from all directions.
// use shared/picture

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return picture.ambient;
}

// choice image
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
