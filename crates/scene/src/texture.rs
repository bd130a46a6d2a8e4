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

/// An image of 8-bit texels, row 0 at the top (`v` = 1), RGB encoded as sRGB, alpha linear.
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
    /// Wrap mode along u and v.
    pub wrap: [Wrap; 2],
}
