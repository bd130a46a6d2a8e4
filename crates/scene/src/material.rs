use crate::{Lobes, TextureRef};

/// Index of a material in [`crate::Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MaterialId(pub u32);

/// How alpha affects visibility.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// The surface is present where alpha is at least `cutoff`.
    Mask {
        /// Smallest alpha that counts as present.
        cutoff: f32,
    },
    /// Each ray hits the surface with probability alpha.
    Blend,
}

/// A metallic-roughness material with specular reflection and transmission. Colors are linear RGB.
///
/// The model is glTF 2.0 with `KHR_materials_specular`, `_transmission` and `_ior`. For a Lambertian surface set `metallic`,
/// `specular` and `transmission` to 0; for a mirror set `metallic` to 1 and `roughness` to 0; for glass set `transmission`
/// to 1. Each factor is multiplied by its texture.
///
/// All surfaces are two-sided: the back looks like the front, with the shading normal flipped. glTF's `doubleSided` is
/// ignored, as in other path tracers (Mitsuba, Cycles): culling back faces would let light pass through walls.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name from the file, used in messages.
    pub name: String,
    /// Diffuse reflectance of dielectrics, reflectance at normal incidence of metals; in 0..=1.
    pub base_color: [f32; 3],
    /// Base color texture.
    pub base_color_texture: Option<TextureRef>,
    /// 0 for dielectrics, 1 for metals.
    pub metallic: f32,
    /// 0 for smooth, 1 for rough; the microfacet alpha is its square.
    pub roughness: f32,
    /// Roughness (green) and metallic (blue) texture.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Strength of the specular reflection of dielectrics, in 0..=1; 0 gives a Lambertian surface.
    pub specular: f32,
    /// Fraction of the light transmitted instead of diffusely reflected, in 0..=1.
    pub transmission: f32,
    /// Transmission texture (red).
    pub transmission_texture: Option<TextureRef>,
    /// Index of refraction, from 1 to [`Material::MAX_IOR`].
    pub ior: f32,
    /// Whether the surface is a thin sheet without refraction rather than the boundary of a solid.
    pub thin_walled: bool,
    /// Tangent-space normal map; z is the shading normal, x the direction of increasing `u`, y of increasing `v`.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the x and y components of the normal map.
    pub normal_scale: f32,
    /// Emitted radiance, the same on both sides.
    pub emission: [f32; 3],
    /// Emission texture.
    pub emission_texture: Option<TextureRef>,
    /// How alpha is used.
    pub alpha_mode: AlphaMode,
    /// Alpha factor, in 0..=1.
    pub alpha: f32,
    /// Texture whose alpha channel is multiplied by `alpha`; its color channels are ignored.
    pub alpha_texture: Option<TextureRef>,
    /// Further lobes; `None` for most materials.
    pub lobes: Option<Box<Lobes>>,
}

impl Default for Material {
    /// A gray Lambertian surface of reflectance 0.8 without textures.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [0.8; 3],
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            specular: 0.0,
            transmission: 0.0,
            transmission_texture: None,
            ior: 1.5,
            thin_walled: false,
            normal_texture: None,
            normal_scale: 1.0,
            emission: [0.0; 3],
            emission_texture: None,
            alpha_mode: AlphaMode::Opaque,
            alpha: 1.0,
            alpha_texture: None,
            lobes: None,
        }
    }
}

impl Material {
    /// Largest index of refraction: nearly all light is reflected. The squares of it and of its inverse are well within the
    /// range of `f32`.
    pub const MAX_IOR: f32 = 1000.0;

    /// All texture references of the material.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.transmission_texture,
            &self.normal_texture,
            &self.emission_texture,
            &self.alpha_texture,
        ]
        .into_iter()
        .flatten()
        .chain(self.lobes.iter().flat_map(|lobes| lobes.textures()))
    }

    /// The further lobes, to change them; creates them.
    pub fn lobes_mut(&mut self) -> &mut Lobes {
        self.lobes.get_or_insert_default()
    }

    /// All texture slots.
    pub(crate) fn textures_mut(&mut self) -> impl Iterator<Item = &mut Option<TextureRef>> {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.transmission_texture,
            &mut self.normal_texture,
            &mut self.emission_texture,
            &mut self.alpha_texture,
        ]
        .into_iter()
        .chain(self.lobes.iter_mut().flat_map(|lobes| lobes.textures_mut()))
    }

    /// Whether alpha can make parts of the surface invisible.
    #[must_use]
    pub fn uses_alpha(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque
    }

    /// Whether no ray hits the surface: textures and vertex colors only lower alpha.
    #[must_use]
    pub fn is_invisible(&self) -> bool {
        match self.alpha_mode {
            AlphaMode::Opaque => false,
            AlphaMode::Mask { cutoff } => self.alpha < cutoff,
            AlphaMode::Blend => self.alpha == 0.0,
        }
    }

    /// Whether the material emits light.
    #[must_use]
    pub fn is_emissive(&self) -> bool {
        self.emission != [0.0; 3]
    }
}
