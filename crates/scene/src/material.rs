use crate::TextureRef;

/// Index of a material in [`crate::Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MaterialId(pub u32);

/// How alpha decides where a surface is.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum AlphaMode {
    /// Everywhere; alpha is ignored.
    #[default]
    Opaque,
    /// Where alpha is `cutoff` or more.
    Mask {
        /// Least alpha of what is present.
        cutoff: f32,
    },
    /// With the probability alpha, decided anew for each ray.
    Blend,
}

/// A surface: metal, or a body that scatters below a clear interface, or lets light through. Colours are linear.
///
/// The model is that of glTF 2.0 with `KHR_materials_specular`, `_transmission` and `_ior`. A Lambert surface has
/// `metallic`, `specular` and `transmission` 0, a mirror `metallic` 1 and `roughness` 0, glass `transmission` 1.
/// Each factor is multiplied with its texture.
///
/// All surfaces have two sides: from behind, a surface looks as from the front, its shading normal turned over. glTF's
/// `doubleSided` asks rasterisers to leave back faces out where it is false; path tracers (Mitsuba, Cycles) show them,
/// as light does not pass a wall for being seen from behind.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, for messages.
    pub name: String,
    /// Diffuse reflectance of what is no metal, reflectance at normal incidence of what is; in 0..=1.
    pub base_color: [f32; 3],
    /// Texture of the base colour.
    pub base_color_texture: Option<TextureRef>,
    /// 0 for bodies, 1 for metals.
    pub metallic: f32,
    /// 0 for polished, 1 for rough; the microfacets' width is its square.
    pub roughness: f32,
    /// Texture of roughness (green) and metallic (blue).
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Strength of the reflection at the interface of what is no metal, in 0..=1; 0 makes it Lambert.
    pub specular: f32,
    /// Share of the light that passes the interface and goes through instead of scattering, in 0..=1.
    pub transmission: f32,
    /// Texture of the transmission (red).
    pub transmission_texture: Option<TextureRef>,
    /// Index of refraction, from 1 to [`Material::MAX_IOR`].
    pub ior: f32,
    /// Whether the surface is a sheet, which light passes straight, or the skin of a body, which bends it.
    pub thin_walled: bool,
    /// Tangent-space normals; z is along the shading normal, x along growing `u`, y along growing `v`.
    pub normal_texture: Option<TextureRef>,
    /// Factor of the x and y of those normals.
    pub normal_scale: f32,
    /// Emitted radiance, the same on both sides.
    pub emission: [f32; 3],
    /// Texture of the emission.
    pub emission_texture: Option<TextureRef>,
    /// Where the surface is.
    pub alpha_mode: AlphaMode,
    /// Factor of alpha, in 0..=1.
    pub alpha: f32,
    /// Texture whose alpha channel is multiplied in; its colour channels are ignored.
    pub alpha_texture: Option<TextureRef>,
}

impl Default for Material {
    /// A grey Lambert surface of reflectance 0.8 without textures.
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
        }
    }
}

impl Material {
    /// Greatest index of refraction: a boundary that reflects nearly all. Squares of it and of its inverse are far from the
    /// ends of single precision.
    pub const MAX_IOR: f32 = 1000.0;

    /// All textures, as the material refers to them.
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
    }

    /// As [`Material::textures`], to be changed; `None` for those that it does without.
    pub(crate) fn textures_mut(&mut self) -> [&mut Option<TextureRef>; 6] {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.transmission_texture,
            &mut self.normal_texture,
            &mut self.emission_texture,
            &mut self.alpha_texture,
        ]
    }

    /// Whether rays may pass the surface where alpha says so.
    #[must_use]
    pub fn uses_alpha(&self) -> bool {
        match self.alpha_mode {
            AlphaMode::Opaque => false,
            AlphaMode::Mask { .. } | AlphaMode::Blend => true,
        }
    }

    /// Whether it gives light.
    #[must_use]
    pub fn is_emissive(&self) -> bool {
        self.emission != [0.0; 3]
    }
}
