/// Index of a texture in [`crate::Scene::textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TextureId(pub u32);

/// What lies outside 0..=1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The border texel continues.
    Clamp,
    /// The image repeats, every other copy mirrored.
    Mirror,
}

/// What the bytes of red, green and blue mean. Alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Encoding {
    /// Colours, encoded by the sRGB curve.
    #[default]
    Srgb,
    /// Numbers: 0 is 0, 255 is 1.
    Linear,
}

/// An image of 8-bit texels, row 0 at the top (`v` = 1).
#[derive(Clone, Debug)]
pub struct Texture {
    /// File or name, for messages.
    pub name: String,
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` texels, RGBA.
    pub texels: Vec<[u8; 4]>,
    /// What the texels mean.
    pub encoding: Encoding,
    /// Wrap mode along u and v.
    pub wrap: [Wrap; 2],
}

/// A texture as a material refers to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// The texture.
    pub texture: TextureId,
    /// Which of [`crate::Mesh::uvs`] places it.
    pub uv_set: UvSet,
    /// Where the texture is looked up, of where the mesh says.
    pub texture_from_mesh: UvTransform,
}

impl TextureRef {
    /// A texture looked up where the first coordinates of the mesh say.
    #[must_use]
    pub const fn new(texture: TextureId) -> Self {
        Self { texture, uv_set: UvSet::First, texture_from_mesh: UvTransform::IDENTITY }
    }
}

/// Which texture coordinates of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum UvSet {
    /// The first.
    #[default]
    First,
    /// The second.
    Second,
}

/// An affine map of texture coordinates, `v` up before and after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// The two rows of the matrix, the translation last.
    pub rows: [[f32; 3]; 2],
}

impl UvTransform {
    /// Changes nothing.
    pub const IDENTITY: Self = Self { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };

    /// The image of a point.
    #[inline]
    #[must_use]
    pub fn point(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        // Without `map`, whose closures stay calls; this runs four times a lookup.
        let along = |[a, b, shift]: [f32; 3]| f64::from(a) * u + f64::from(b) * v + f64::from(shift);
        [along(self.rows[0]), along(self.rows[1])]
    }
}
