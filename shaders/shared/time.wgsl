// part ray_time
// Time of the rays of an invocation: 0 at shutter opening, below 1 until it closes, a multiple of 2^-24.

var<private> ray_time: f32;

// choice still
// No motion.
// use shared/picture

fn choose_time(one: PixelSample) {}

// choice shutter
// Samples are distributed over the shutter interval.
// use shared/picture
// use shared/time/ray_time

/// Sampler dimension of the time, separate from those that integrators count up.
const TIME: u32 = 0xffffffffu;

fn choose_time(one: PixelSample) {
    ray_time = single(picture.sampler, one.pixel, one.sample, TIME);
}
