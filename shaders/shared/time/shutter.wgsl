// Samples are spread over the time that the shutter is open.
// use shared/picture
// use shared/ray_time

/// Dimension that chooses a sample's time, apart from those that integrators count up.
const TIME: u32 = 0xffffffffu;

fn choose_time(one: PixelSample) {
    ray_time = single(picture.sampler, one.pixel, one.sample, TIME);
}
