// Nothing moves: all rays fly at once.
// use shared/picture

fn choose_time(one: PixelSample) {}
