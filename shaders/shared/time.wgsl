// part ray_time
// When the rays of an invocation fly: 0 where the shutter opens, below 1 until it closes, a multiple of 2^-24.

var<private> ray_time: f32;

// choice still
// Nothing moves: all rays fly at once.
// use shared/picture

fn choose_time(one: PixelSample) {}

// choice shutter
// Samples are spread over the time that the shutter is open.
// use shared/picture
// use shared/time/ray_time

/// Dimension that chooses a sample's time, apart from those that integrators count up.
const TIME: u32 = 0xffffffffu;

fn choose_time(one: PixelSample) {
    ray_time = single(picture.sampler, one.pixel, one.sample, TIME);
}
