use crate::TextureId;

/// Index of a material in [`crate::Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MaterialId(pub u32);

/// A Lambert surface that may emit and may be cut out by a mask. Colours are linear.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, for messages.
    pub name: String,
    /// Diffuse reflectance in 0..=1, multiplied with the texture.
    pub albedo: [f32; 3],
    /// Texture of the reflectance, sRGB decoded on lookup.
    pub albedo_texture: Option<TextureId>,
    /// Emitted radiance.
    pub emission: [f32; 3],
    /// Mask: the surface is absent where `alpha` of this texture is below `alpha_cutoff`.
    pub alpha_texture: Option<TextureId>,
    /// Threshold of the mask.
    pub alpha_cutoff: f32,
}

impl Default for Material {
    /// A grey surface of reflectance 0.8 without textures.
    fn default() -> Self {
        Self {
            name: String::new(),
            albedo: [0.8; 3],
            albedo_texture: None,
            emission: [0.0; 3],
            alpha_texture: None,
            alpha_cutoff: 0.5,
        }
    }
}
