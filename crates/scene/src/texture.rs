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
