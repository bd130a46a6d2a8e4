//! Further lobes at a hit: factors times textures, and the direction of anisotropy.

use canted_scene::{Lobes as Source, TextureRef};

use super::hit_triangle::PlacedTriangle;
use super::shading_normal::tangents;
use super::texture_lookup::TextureLookup;
use crate::Lobes;
use crate::vector::{Vector, add, scale};

/// The lobes where `texel` evaluates a texture, and the factor of the dielectric reflection.
pub(super) fn lobes(source: &Source, texel: impl Fn(&Option<TextureRef>) -> [f32; 4]) -> (Lobes, f32) {
    let times = |color: [f32; 3], texture| {
        let texel = texel(texture);
        std::array::from_fn(|k| color[k] * texel[k])
    };
    let channel = |factor: f32, texture, channel: usize| factor * texel(texture)[channel];
    let [thin, thick] = source.iridescence_thickness;
    let lobes = Lobes {
        specular_color: times(source.specular_color, &source.specular_color_texture),
        clearcoat: channel(source.clearcoat, &source.clearcoat_texture, 0),
        clearcoat_roughness: channel(source.clearcoat_roughness, &source.clearcoat_roughness_texture, 1),
        sheen_color: times(source.sheen_color, &source.sheen_color_texture),
        sheen_roughness: channel(source.sheen_roughness, &source.sheen_roughness_texture, 3),
        anisotropy: channel(source.anisotropy, &source.anisotropy_texture, 2),
        direction: [1.0, 0.0],
        iridescence: channel(source.iridescence, &source.iridescence_texture, 0),
        iridescence_ior: source.iridescence_ior,
        iridescence_thickness: thin + (thick - thin) * texel(&source.iridescence_thickness_texture)[1],
        absorption: source.absorption,
    };
    (lobes, texel(&source.specular_texture)[3])
}

/// The direction of longer highlights, world space; `None` where the mesh has no tangents and no texture coordinates.
pub(super) fn anisotropy(
    source: &Source,
    placed: &PlacedTriangle,
    lookup: Option<&TextureLookup>,
    normal: Vector,
) -> Option<Vector> {
    let texture = source.anisotropy_texture.as_ref();
    let [u, v] = tangents(texture, placed, lookup, normal)?;
    let texel = texture.zip(lookup).and_then(|(slot, lookup)| lookup.sample(slot));
    let [x, y] = texel.map_or([1.0, 0.0], |[x, y, ..]| [x, y].map(|c| 2.0 * f64::from(c) - 1.0));
    let (sine, cosine) = f64::from(source.anisotropy_rotation).sin_cos();
    Some(add(scale(u, cosine * x - sine * y), scale(v, sine * x + cosine * y)))
}
