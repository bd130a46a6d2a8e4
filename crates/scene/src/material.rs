//! Materials and the textures they refer to.

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
/// The back of a surface looks like the front, with the shading normal flipped, unless [`Material::double_sided`] is false.
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
    /// Whether the back is seen, too; glTF's `doubleSided`. Surfaces that transmit light are seen from both sides.
    pub double_sided: bool,
    /// Further lobes; `None` for most materials.
    pub lobes: Option<Box<Lobes>>,
    /// The scattering of hair, on curves; `None` for other materials.
    pub hair: Option<Box<Hair>>,
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
            double_sided: true,
            lobes: None,
            hair: None,
        }
    }
}

/// How hair scatters light: Chiang et al. 2016. Its index of refraction is that of the material.
#[derive(Clone, Debug, PartialEq)]
pub struct Hair {
    /// Whether the material is hair.
    pub is_on: bool,
    /// Concentration of eumelanin, at least 0: 0.3 is blond, 1.3 brown, 8 black. Where both concentrations are 0, hair has the base color.
    pub melanin: f32,
    /// Concentration of pheomelanin, which makes hair red, at least 0.
    pub pheomelanin: f32,
    /// Roughness along the hair, in 0..=1.
    pub roughness: f32,
    /// Roughness around the hair, in 0..=1.
    pub roughness_around: f32,
    /// Angle of the scales, degrees.
    pub tilt_degrees: f32,
}

impl Default for Hair {
    /// Values of human hair; not on.
    fn default() -> Self {
        Self { is_on: false, melanin: 0.0, pheomelanin: 0.0, roughness: 0.3, roughness_around: 0.3, tilt_degrees: 2.0 }
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

    /// The scattering of hair, to change it; creates it.
    pub fn hair_mut(&mut self) -> &mut Hair {
        self.hair.get_or_insert_default()
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

/// Index of a texture in [`crate::Scene::textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TextureId(pub u32);

/// Texture lookup outside 0..=1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The border texel is repeated.
    Clamp,
    /// The image repeats; every other copy is mirrored.
    Mirror,
}

/// Encoding of red, green and blue. Alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Encoding {
    /// sRGB-encoded colors.
    #[default]
    Srgb,
    /// Linear values: byte 255 is 1.
    Linear,
}

/// What a lookup between texels gives where a texel is larger than a pixel. Smaller texels are always averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Magnification {
    /// Bilinear interpolation.
    #[default]
    Linear,
    /// The nearest texel.
    Nearest,
}

/// An image of 8-bit texels, row 0 at the top (`v` = 1).
#[derive(Clone, Debug)]
pub struct Texture {
    /// Name used in messages.
    pub name: String,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `width * height` RGBA texels in row order.
    pub texels: Vec<[u8; 4]>,
    /// Encoding of the texels.
    pub encoding: Encoding,
    /// Wrap mode along u and v.
    pub wrap: [Wrap; 2],
    /// Lookup between texels.
    pub magnification: Magnification,
}

impl Texture {
    /// A texture that repeats and is interpolated.
    pub(crate) fn new(name: &str, [width, height]: [u32; 2], texels: Vec<[u8; 4]>, encoding: Encoding) -> Self {
        let (wrap, magnification) = ([Wrap::Repeat; 2], Magnification::Linear);
        Self { name: name.to_owned(), width, height, texels, encoding, wrap, magnification }
    }
}

/// A reference from a material to a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// The texture.
    pub texture: TextureId,
    /// Texture coordinate set used for the lookup.
    pub uv_set: UvSet,
    /// Transform applied to the mesh's texture coordinates.
    pub texture_from_mesh: UvTransform,
}

impl TextureRef {
    /// A texture looked up by the first, untransformed texture coordinates.
    #[must_use]
    pub const fn new(texture: TextureId) -> Self {
        Self { texture, uv_set: UvSet::First, texture_from_mesh: UvTransform::IDENTITY }
    }
}

/// A texture coordinate set of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum UvSet {
    /// [`crate::Mesh::uvs`].
    #[default]
    First,
    /// [`crate::Mesh::second_uvs`].
    Second,
}

/// An affine transform of texture coordinates; `v` points up before and after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// The two rows of the matrix; the last column is the translation.
    pub rows: [[f32; 3]; 2],
}

impl UvTransform {
    /// The identity.
    pub const IDENTITY: Self = Self { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };

    /// Transforms a point.
    #[inline]
    #[must_use]
    pub fn point(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        // Not `map`: its closure is not inlined here, and this runs four times per lookup.
        let along = |[a, b, shift]: [f32; 3]| f64::from(a) * u + f64::from(b) * v + f64::from(shift);
        [along(self.rows[0]), along(self.rows[1])]
    }
}
