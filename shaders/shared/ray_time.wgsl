// When the rays of an invocation fly: 0 where the shutter opens, below 1 until it closes, a multiple of 2^-24.

var<private> ray_time: f32;
