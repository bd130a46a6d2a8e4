//! What textures say: at a point, or on average over the part of a surface that a ray stands for.
//!
//! ```text
//! scene's textures -> pyramid (halved again and again, in linear light)
//! cone of a ray, triangle -> footprint (an ellipse of texels) -> lookup in the pyramid -> numbers in 0..=1
//! ```

mod cone;
mod footprint;
mod lookup;
mod pyramid;

use canted_scene::{Material, Scene, Texture, TextureId, TextureRef};
use rayon::prelude::*;

pub use cone::Cone;
pub(crate) use footprint::{Footprint, Plane};
pub(crate) use pyramid::Pyramid;

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
    pyramids: Vec<Pyramid<'a>>,
}

impl<'a> Textures<'a> {
    /// Prepares all textures of `scene`; those that are averaged get their smaller copies.
    ///
    /// Masks are looked up at full size: an averaged alpha would move the edge of what it cuts out.
    pub(crate) fn new(scene: &'a Scene, lod: Lod) -> Self {
        let mut uses = vec![Use::default(); scene.textures.len()];
        for material in &scene.materials {
            for slot in averaged(material) {
                let asked = &mut uses[slot.texture.0 as usize];
                asked.is_averaged = lod != Lod::None;
                asked.is_cut_out |= material.is_cut_out();
            }
        }
        let pyramid = |(texture, asked): (&'a Texture, &Use)| {
            if asked.is_averaged { Pyramid::new(texture, asked.is_cut_out) } else { Pyramid::flat(texture) }
        };
        Self { pyramids: scene.textures.par_iter().zip(&uses).map(pyramid).collect() }
    }

    pub(crate) fn get(&self, id: TextureId) -> &Pyramid<'a> {
        &self.pyramids[id.0 as usize]
    }
}

/// What is asked of a texture.
#[derive(Clone, Copy, Default)]
struct Use {
    is_averaged: bool,
    /// Whether a material shows it only where alpha lets it.
    is_cut_out: bool,
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
