/// Environment light: radiance from infinitely far away.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// Constant in all directions, linear RGB.
    Constant([f32; 3]),
    /// An environment map.
    Image(EnvironmentImage),
}

/// An environment map in equirectangular projection, linear RGB radiance.
///
/// World +y is up: the top edge maps to +y, the bottom edge to -y. The image center maps to -z, the view direction of an
/// unrotated glTF camera; +x is to its right. `turn_degrees` rotates the map about +y, counter-clockwise seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentImage {
    /// Name used in messages.
    pub name: String,
    /// Width in texels, along the longitude.
    pub width: u32,
    /// Height in texels, from zenith to nadir.
    pub height: u32,
    /// `width * height` texels in row order, finite and not negative.
    pub texels: Vec<[f32; 3]>,
    /// Multiplier of all texels.
    pub scale: [f32; 3],
    /// Rotation about +y in degrees.
    pub turn_degrees: f32,
}

impl From<[f32; 3]> for Environment {
    fn from(radiance: [f32; 3]) -> Self {
        Self::Constant(radiance)
    }
}
