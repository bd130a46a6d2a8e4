// choice one
// Texels in one binding: the sRGB table, one f32 per byte value, then all levels of all textures.

@group(2) @binding(6) var<storage, read> texels_0: array<u32>;

fn texel_word(index: u32) -> u32 {
    return texels_0[index];
}

// choice four
// Texels in four bindings, for more data than one may hold: the sRGB table, one f32 per byte value, then all levels of all
// textures, split every `TEXELS_PER_BINDING`.
// const TEXELS_PER_BINDING

@group(2) @binding(6) var<storage, read> texels_0: array<u32>;
@group(2) @binding(7) var<storage, read> texels_1: array<u32>;
@group(2) @binding(8) var<storage, read> texels_2: array<u32>;
@group(2) @binding(9) var<storage, read> texels_3: array<u32>;

fn texel_word(index: u32) -> u32 {
    let within = index % TEXELS_PER_BINDING;
    switch index / TEXELS_PER_BINDING {
        case 0u: { return texels_0[within]; }
        case 1u: { return texels_1[within]; }
        case 2u: { return texels_2[within]; }
        default: { return texels_3[within]; }
    }
}
