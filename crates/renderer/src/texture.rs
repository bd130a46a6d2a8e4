//! Texture lookups: filtered over the ray's footprint, or at a point.
//!
//! ```text
//! textures of the scene    -> mip_map (mip levels, filtered in linear light)
//! ray cone, triangle       -> footprint (an ellipse) -> lookup in the mip_map -> values in 0..=1
//! ```

mod cone;
mod footprint;
mod lookup;
mod mip_map;

use std::sync::Arc;

use canted_scene::{Material, Scene, Texture, TextureId, TextureRef};
use rayon::prelude::*;

use mip_map::Reduced;

pub use cone::Cone;
pub(crate) use footprint::{Footprint, Plane};
pub(crate) use mip_map::MipMap;

/// Texture filtering.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Lod {
    /// No mip maps: bilinear lookups at full resolution.
    None,
    /// Isotropic: a square as wide as the longer axis of the ray cone's footprint. Never aliases, but blurs at grazing
    /// angles.
    Cone,
    /// Anisotropic: the elliptical footprint of the cone, up to 16:1, for directly visible surfaces and mirror
    /// reflections; after other scattering, [`Lod::Cone`].
    #[default]
    Aniso,
}

/// The textures of a scene with their mip maps.
#[derive(Clone, Debug)]
pub(crate) struct Textures<'a> {
    mip_maps: Vec<MipMap<'a>>,
}

impl<'a> Textures<'a> {
    /// Prepares all textures of `scene`. Filtered textures get mip maps.
    ///
    /// Alpha textures do not: averaging alpha would move the edges of cutouts.
    pub(crate) fn new(scene: &'a Scene, lod: Lod) -> Self {
        let mut uses = vec![Use::default(); scene.textures.len()];
        for material in &scene.materials {
            // A texture that is visible only where its own alpha is high is filtered with alpha weights.
            let mask = material.alpha_texture.as_ref().filter(|_| material.uses_alpha());
            for slot in filtered_textures(material) {
                let usage = &mut uses[slot.texture.0 as usize];
                usage.is_filtered = lod != Lod::None;
                usage.ignores_alpha |= mask != Some(slot);
            }
        }
        let mip_map = |(texture, usage): (&'a Texture, &Use)| {
            if usage.is_filtered { MipMap::new(texture, !usage.ignores_alpha) } else { MipMap::flat(texture) }
        };
        Self { mip_maps: scene.textures.par_iter().zip(&uses).map(mip_map).collect() }
    }

    /// As [`Textures::new`] with the mip levels of another frame; builds them where they are not those of such textures.
    pub(crate) fn with_mip_maps(scene: &'a Scene, lod: Lod, known: &MipMaps) -> Self {
        let sizes = scene.textures.iter().map(|texture| [texture.width, texture.height]);
        if lod != known.lod || !sizes.eq(known.levels.iter().map(|(size, _)| *size)) {
            return Self::new(scene, lod);
        }
        let levels = known.levels.iter().map(|(_, levels)| levels);
        Self { mip_maps: scene.textures.iter().zip(levels).map(|(t, levels)| MipMap::with_levels(t, levels)).collect() }
    }

    /// The mip levels.
    pub(crate) fn mip_maps(&self, lod: Lod) -> MipMaps {
        let of_one = |mip_map: &MipMap| (mip_map.level(0).size, Arc::clone(mip_map.shared_levels()));
        MipMaps { lod, levels: self.mip_maps.iter().map(of_one).collect() }
    }

    pub(crate) fn get(&self, id: TextureId) -> &MipMap<'a> {
        &self.mip_maps[id.0 as usize]
    }
}

/// Mip levels of the textures of a scene, for later frames of the same scene.
#[derive(Clone, Debug)]
pub struct MipMaps {
    lod: Lod,
    /// Size of each texture, and its levels above 0.
    levels: Vec<([u32; 2], Arc<Vec<Reduced>>)>,
}

/// How materials use a texture.
#[derive(Clone, Copy, Default)]
struct Use {
    is_filtered: bool,
    /// Whether any material shows it regardless of its alpha.
    ignores_alpha: bool,
}

/// The textures of a material except for alpha.
pub(crate) fn filtered_textures(material: &Material) -> impl Iterator<Item = &TextureRef> {
    [
        &material.base_color_texture,
        &material.metallic_roughness_texture,
        &material.transmission_texture,
        &material.normal_texture,
        &material.emission_texture,
    ]
    .into_iter()
    .flatten()
    .chain(material.lobes.iter().flat_map(|lobes| lobes.textures()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_scene::{AlphaMode, Encoding, Magnification, UvSet, Wrap};

    /// The color of the coarsest mip level of a texture that is half white and half black, the black half transparent.
    fn smallest(materials: Vec<Material>) -> u8 {
        let texels = vec![[255; 4], [0; 4]];
        let (name, encoding, wrap) = (String::new(), Encoding::Linear, [Wrap::Repeat; 2]);
        let texture =
            Texture { name, width: 2, height: 1, texels, encoding, wrap, magnification: Magnification::Linear };
        let scene = Scene { textures: vec![texture], materials, ..Scene::default() };
        let textures = Textures::new(&scene, Lod::Aniso);
        let mip_map = textures.get(TextureId(0));
        mip_map.level(mip_map.n_levels() - 1).texels[0][0]
    }

    /// Colors are weighted by alpha only if it is the texture's own alpha that cuts it out.
    #[test]
    fn alpha_weights_only_colors_that_it_cuts_out() {
        const ALL: u8 = 128;
        const SEEN: u8 = 255;
        let slot = Some(TextureRef::new(TextureId(0)));
        let mask = Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..Material::default() };
        let leaf = Material { base_color_texture: slot, alpha_texture: slot, ..mask.clone() };
        let sign = Material { emission_texture: slot, alpha_texture: slot, ..mask.clone() };
        let blended = Material { alpha_mode: AlphaMode::Blend, ..leaf.clone() };
        for weighted in [&leaf, &sign, &blended] {
            assert_eq!(smallest(vec![weighted.clone()]), SEEN, "{weighted:?}");
        }
        let elsewhere = Some(TextureRef { uv_set: UvSet::Second, ..TextureRef::new(TextureId(0)) });
        for unweighted in [
            Material { alpha_mode: AlphaMode::Opaque, ..leaf.clone() },
            Material { base_color_texture: slot, ..mask.clone() },
            Material { emission_texture: slot, ..mask.clone() },
            Material { roughness: 0.5, metallic_roughness_texture: slot, ..mask },
            Material { base_color_texture: elsewhere, ..leaf.clone() },
        ] {
            assert_eq!(smallest(vec![unweighted.clone()]), ALL, "{unweighted:?}");
            assert_eq!(smallest(vec![leaf.clone(), unweighted]), ALL);
        }
    }
}
