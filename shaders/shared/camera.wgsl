// Camera rays: filter, lens, and ray cone.
//
// `?view` is the projection, `?lens` a pinhole or a thin lens, `?filter` the pixel filter.
//
// Positions are relative to the center of the picture, so they round by at most 2^-13 of a pixel in pictures up to 4096 pixels
// wide. Directions round by about 2^-22.
// use shared/picture
// use shared/ray
// use shared/cone
// use ?view
// use ?lens
// use ?filter

/// Sampler dimension of the position in the pixel.
const PIXEL_POSITION: u32 = 0u;

/// Sampler dimension of the position on the lens, separate from those that integrators count up.
const LENS: u32 = 0xfffffffeu;

struct CameraRay {
    ray: Ray,
    cone: Cone,
}

fn camera_ray(one: PixelSample) -> CameraRay {
    let offset = filtered(square(one, PIXEL_POSITION));
    let position = (vec2<f32>(one.at) + 0.5 - 0.5 * vec2<f32>(picture.size)) + offset;
    let line = through_lens(line_of(position), one);
    return CameraRay(line, pixel_cone(position, one.sample));
}

/// A ray with infinite `t_max`.
fn infinite_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    return Ray(origin, 0.0, direction, FAR);
}
