// choice black
// Nothing shines from outside.

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return vec3(0.0);
}

// choice constant
// The same light from everywhere.
// use shared/picture

fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    return picture.ambient;
}

// choice image
// A picture of all directions, by longitude and latitude; twin of crates/renderer/src/light/environment.rs.
//
// The middle of the picture looks along -z, its top edge is +y. A direction's place in the picture is off by some
// 2^-22 of its width and height.
// use shared/numbers
// use shared/angle

struct SkyImage {
    /// Factor of all texels, linear RGB.
    scale: vec3<f32>,
    width: u32,
    height: u32,
    /// Share of a turn about +y, counter-clockwise, in 0..1.
    turn: f32,
}

@group(3) @binding(1) var<uniform> sky_image: SkyImage;
/// Three numbers a texel, row by row from the zenith.
@group(3) @binding(2) var<storage, read> sky_texels: array<f32>;

/// Radiance that arrives against a direction of any length: bilinear between texel centres.
fn sky_radiance(direction: vec3<f32>) -> vec3<f32> {
    let size = vec2(sky_image.width, sky_image.height);
    let texels = sky_place(direction) * vec2<f32>(size) - 0.5;
    let first = floor(texels);
    let weight = texels - first;
    let corner = vec2<i32>(first);
    // The picture goes on around the horizon and ends in its first and last row.
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

/// Where a direction is: across, in 0..=1 from the left edge, and down, in 0..=1 from the top.
fn sky_place(direction: vec3<f32>) -> vec2<f32> {
    let most = max(max(abs(direction.x), abs(direction.y)), max(abs(direction.z), 1e-30));
    let d = direction / most;
    let across = angle_of(d.x, -d.z) / TAU + 0.5 + sky_image.turn;
    return vec2(across - floor(across), angle_of(length(d.xz), d.y) / PI);
}

/// The unit direction of a longitude across the picture and a cosine to +y.
fn sky_direction(across: f32, cosine: f32) -> vec3<f32> {
    let turned = circle(across - sky_image.turn - 0.5);
    let sine = sqrt(max((1.0 - cosine) * (1.0 + cosine), 0.0));
    return vec3(sine * turned.y, cosine, -sine * turned.x);
}
