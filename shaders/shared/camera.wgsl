// Camera rays: where the filter puts a sample, through the lens, and the cone that the ray stands for.
//
// `?view` is perspective or orthographic, `?lens` a pinhole or a disc, `?filter` a box or a table.
//
// Positions are kept relative to the middle of the picture, so they round by 2^-13 of a pixel at most in pictures up to 4096
// pixels wide; a ray's direction rounds by some 2^-22.
// use shared/picture
// use shared/ray
// use shared/cone
// use ?view
// use ?lens
// use ?filter

/// Dimension of the sampler that places a sample in its pixel.
const PIXEL_POSITION: u32 = 0u;

/// Dimension that places a sample on the lens, apart from those that integrators count up.
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

/// A ray without end.
fn endless(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    return Ray(origin, 0.0, direction, FAR);
}
