// Texels in one binding: first the sRGB curve, one f32 a byte, then all levels of all textures.

@group(2) @binding(6) var<storage, read> texels_0: array<u32>;

fn texel_word(index: u32) -> u32 {
    return texels_0[index];
}
