/// Radiance that arrives from infinitely far away.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// The same from everywhere, linear RGB.
    Constant([f32; 3]),
    /// A picture of all directions.
    Image(EnvironmentImage),
}

/// A picture of all directions by longitude and latitude, linear RGB radiance.
///
/// World +y is up: the top edge is +y, the bottom edge -y. The middle of the picture looks along -z, as an unrotated
/// camera of glTF does, and what is right of it lies towards +x. `turn_degrees` turns the picture about +y,
/// counter-clockwise seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentImage {
    /// File or name, for messages.
    pub name: String,
    /// Texels in a row, around the horizon.
    pub width: u32,
    /// Rows, from zenith to nadir.
    pub height: u32,
    /// `width * height` texels, finite and not negative.
    pub texels: Vec<[f32; 3]>,
    /// Factor of all texels.
    pub scale: [f32; 3],
    /// Angle by which the picture is turned about +y.
    pub turn_degrees: f32,
}

impl From<[f32; 3]> for Environment {
    fn from(radiance: [f32; 3]) -> Self {
        Self::Constant(radiance)
    }
}
