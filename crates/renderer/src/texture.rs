//! What textures say: at a point, or on average over the part of a surface that a ray stands for.
//!
//! ```text
//! scene's textures -> mip_map (halved again and again, in linear light)
//! cone of a ray, triangle -> footprint (an ellipse of texels) -> lookup in the mip_map -> numbers in 0..=1
//! ```

mod cone;
mod footprint;
mod lookup;
mod mip_map;

use canted_scene::{Material, Scene, Texture, TextureId, TextureRef};
use rayon::prelude::*;

pub use cone::Cone;
pub(crate) use footprint::{Footprint, Plane};
pub(crate) use mip_map::MipMap;

/// How much of a texture a lookup averages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Lod {
    /// The four texels about a point, however far it is.
    None,
    /// A square as wide as the longer axis of what the ray's cone covers: never noisy, blurred where surfaces lean away.
    Cone,
    /// The ellipse that the cone covers, up to 16 times as long as wide, where only mirrors lie between the surface and the
    /// camera; behind scattering [`Lod::Cone`].
    #[default]
    Aniso,
}

/// The textures of a scene, ready to be looked up.
#[derive(Clone, Debug)]
pub(crate) struct Textures<'a> {
    mip_maps: Vec<MipMap<'a>>,
}

impl<'a> Textures<'a> {
    /// Prepares all textures of `scene`; those that are averaged get their smaller copies.
    ///
    /// Masks are looked up at full size: an averaged alpha would move the edge of what it cuts out.
    pub(crate) fn new(scene: &'a Scene, lod: Lod) -> Self {
        let mut uses = vec![Use::default(); scene.textures.len()];
        for material in &scene.materials {
            // What this texture shows is seen where its own alpha lets it.
            let mask = material.alpha_texture.as_ref().filter(|_| material.uses_alpha());
            for slot in averaged(material) {
                let asked = &mut uses[slot.texture.0 as usize];
                asked.is_averaged = lod != Lod::None;
                asked.is_seen_whole |= mask != Some(slot);
            }
        }
        let mip_map = |(texture, asked): (&'a Texture, &Use)| {
            if asked.is_averaged { MipMap::new(texture, !asked.is_seen_whole) } else { MipMap::flat(texture) }
        };
        Self { mip_maps: scene.textures.par_iter().zip(&uses).map(mip_map).collect() }
    }

    pub(crate) fn get(&self, id: TextureId) -> &MipMap<'a> {
        &self.mip_maps[id.0 as usize]
    }
}

/// What is asked of a texture.
#[derive(Clone, Copy, Default)]
struct Use {
    is_averaged: bool,
    /// Whether a material shows it also where its alpha is small.
    is_seen_whole: bool,
}

/// The textures of a material but that of alpha.
pub(crate) fn averaged(material: &Material) -> impl Iterator<Item = &TextureRef> {
    [
        &material.base_color_texture,
        &material.metallic_roughness_texture,
        &material.transmission_texture,
        &material.normal_texture,
        &material.emission_texture,
    ]
    .into_iter()
    .flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_scene::{AlphaMode, Encoding, UvSet, Wrap};

    /// The colour of the smallest copy of a texture that is half white and half black, of which alpha cuts out the black.
    fn smallest(materials: Vec<Material>) -> u8 {
        let texels = vec![[255; 4], [0; 4]];
        let (name, encoding, wrap) = (String::new(), Encoding::Linear, [Wrap::Repeat; 2]);
        let texture = Texture { name, width: 2, height: 1, texels, encoding, wrap };
        let scene = Scene { textures: vec![texture], materials, ..Scene::default() };
        let textures = Textures::new(&scene, Lod::Aniso);
        let mip_map = textures.get(TextureId(0));
        mip_map.level(mip_map.n_levels() - 1).texels[0][0]
    }

    /// Colours are weighed by the alpha that says where they are seen, and by no other.
    #[test]
    fn colours_are_weighed_by_the_mask_that_cuts_them_out() {
        const ALL: u8 = 128;
        const SEEN: u8 = 255;
        let slot = Some(TextureRef::new(TextureId(0)));
        let mask = Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..Material::default() };
        let leaf = Material { base_color_texture: slot, alpha_texture: slot, ..mask.clone() };
        let sign = Material { emission_texture: slot, alpha_texture: slot, ..mask.clone() };
        let blended = Material { alpha_mode: AlphaMode::Blend, ..leaf.clone() };
        for seen in [&leaf, &sign, &blended] {
            assert_eq!(smallest(vec![seen.clone()]), SEEN, "{seen:?}");
        }
        let elsewhere = Some(TextureRef { uv_set: UvSet::Second, ..TextureRef::new(TextureId(0)) });
        for whole in [
            Material { alpha_mode: AlphaMode::Opaque, ..leaf.clone() },
            Material { base_color_texture: slot, ..mask.clone() },
            Material { emission_texture: slot, ..mask.clone() },
            Material { roughness: 0.5, metallic_roughness_texture: slot, ..mask },
            Material { base_color_texture: elsewhere, ..leaf.clone() },
        ] {
            assert_eq!(smallest(vec![whole.clone()]), ALL, "{whole:?}");
            assert_eq!(smallest(vec![leaf.clone(), whole]), ALL);
        }
    }
}
