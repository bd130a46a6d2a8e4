// No light is given.
// use shared/light/asked

fn ask(one: PixelSample, vertex: u32, surface: Surface, vertex_key: u32, n_asked: u32) -> Asked {
    return NOT_ASKED;
}
