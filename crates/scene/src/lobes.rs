use crate::TextureRef;

/// Further lobes of a [`Material`](crate::Material), after the glTF extensions `KHR_materials_specular` (its color), `_clearcoat`,
/// `_sheen`, `_anisotropy`, `_iridescence` and `_volume` (its absorption). Colors are linear RGB; each factor is multiplied by its
/// texture. The default has none of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Lobes {
    /// Tint of the dielectric reflection at normal incidence; not limited to 1.
    pub specular_color: [f32; 3],
    /// Texture of `specular_color` (RGB).
    pub specular_color_texture: Option<TextureRef>,
    /// Texture of [`Material::specular`](crate::Material::specular) (alpha).
    pub specular_texture: Option<TextureRef>,
    /// Strength of a clear coat with index of refraction 1.5, in 0..=1.
    pub clearcoat: f32,
    /// Texture of `clearcoat` (red).
    pub clearcoat_texture: Option<TextureRef>,
    /// Roughness of the coat, in 0..=1.
    pub clearcoat_roughness: f32,
    /// Texture of `clearcoat_roughness` (green).
    pub clearcoat_roughness_texture: Option<TextureRef>,
    /// Color of the fibers of a cloth, in 0..=1; black for no sheen.
    pub sheen_color: [f32; 3],
    /// Texture of `sheen_color` (RGB).
    pub sheen_color_texture: Option<TextureRef>,
    /// Roughness of the fibers, in 0..=1.
    pub sheen_roughness: f32,
    /// Texture of `sheen_roughness` (alpha).
    pub sheen_roughness_texture: Option<TextureRef>,
    /// How much longer highlights are along the anisotropy direction, in 0..=1.
    pub anisotropy: f32,
    /// Angle of that direction from the tangent, counter-clockwise, in radians.
    pub anisotropy_rotation: f32,
    /// Texture with the direction (red, green) and a factor of `anisotropy` (blue).
    pub anisotropy_texture: Option<TextureRef>,
    /// Strength of the interference in a thin film, in 0..=1.
    pub iridescence: f32,
    /// Texture of `iridescence` (red).
    pub iridescence_texture: Option<TextureRef>,
    /// Index of refraction of the film, at least 1.
    pub iridescence_ior: f32,
    /// Thickness of the film in nanometers where the texture is 0, and where it is 1 or absent.
    pub iridescence_thickness: [f32; 2],
    /// Texture of the thickness (green).
    pub iridescence_thickness_texture: Option<TextureRef>,
    /// Absorption inside a transmissive solid, per unit of length in world space.
    pub absorption: [f32; 3],
}

impl Default for Lobes {
    fn default() -> Self {
        Self {
            specular_color: [1.0; 3],
            specular_color_texture: None,
            specular_texture: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            sheen_color: [0.0; 3],
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            iridescence: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness: [100.0, 400.0],
            iridescence_thickness_texture: None,
            absorption: [0.0; 3],
        }
    }
}

impl Lobes {
    /// All texture references.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        [
            &self.specular_color_texture,
            &self.specular_texture,
            &self.clearcoat_texture,
            &self.clearcoat_roughness_texture,
            &self.sheen_color_texture,
            &self.sheen_roughness_texture,
            &self.anisotropy_texture,
            &self.iridescence_texture,
            &self.iridescence_thickness_texture,
        ]
        .into_iter()
        .flatten()
    }

    /// All texture slots.
    pub(crate) fn textures_mut(&mut self) -> [&mut Option<TextureRef>; 9] {
        [
            &mut self.specular_color_texture,
            &mut self.specular_texture,
            &mut self.clearcoat_texture,
            &mut self.clearcoat_roughness_texture,
            &mut self.sheen_color_texture,
            &mut self.sheen_roughness_texture,
            &mut self.anisotropy_texture,
            &mut self.iridescence_texture,
            &mut self.iridescence_thickness_texture,
        ]
    }
}
