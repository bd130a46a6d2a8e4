//! Lights other than emissive meshes, and the environment.

/// A light source other than an emissive mesh. World space; all colors linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Directional light.
    Sun {
        /// Unit direction of propagation.
        direction: [f32; 3],
        /// Irradiance on a surface perpendicular to `direction`, W/m².
        irradiance: [f32; 3],
    },
    /// Isotropic point light.
    Point {
        /// Position.
        position: [f32; 3],
        /// Radiant intensity, W/sr.
        intensity: [f32; 3],
    },
    /// Point light limited to a cone.
    Spot {
        /// Position.
        position: [f32; 3],
        /// Unit direction of the axis.
        direction: [f32; 3],
        /// Radiant intensity along the axis, W/sr.
        intensity: [f32; 3],
        /// Cosine of the angle to the axis inside which the intensity is full.
        cos_inner: f32,
        /// Cosine of the angle outside which the intensity is zero; less than `cos_inner`. Between the two the intensity
        /// is `intensity · ((cosθ - cos_outer) / (cos_inner - cos_outer))²`, as in `KHR_lights_punctual`.
        cos_outer: f32,
    },
    /// Sphere light, emitting outward. Visible to rays.
    Sphere {
        /// Center.
        center: [f32; 3],
        /// Radius, above zero.
        radius: f32,
        /// Emitted radiance, W/(m²·sr).
        radiance: [f32; 3],
    },
    /// One-sided disk light. Visible to rays; the back is black.
    Disk {
        /// Center.
        center: [f32; 3],
        /// Unit normal of the emitting side.
        normal: [f32; 3],
        /// Radius, above zero.
        radius: f32,
        /// Emitted radiance, W/(m²·sr).
        radiance: [f32; 3],
    },
}

impl Light {
    /// The names of all kinds, in the order of [`Light::kind`]: `type` in scene files.
    pub const KINDS: [&'static str; 5] = ["sun", "point", "spot", "sphere", "disk"];

    /// Whether it is off: black in all channels.
    #[must_use]
    pub fn is_off(&self) -> bool {
        let (Self::Sun { irradiance: color, .. }
        | Self::Point { intensity: color, .. }
        | Self::Spot { intensity: color, .. }
        | Self::Sphere { radiance: color, .. }
        | Self::Disk { radiance: color, .. }) = self;
        color.iter().all(|&x| x <= 0.0)
    }

    /// Its kind, as an index of [`Light::KINDS`].
    #[must_use]
    pub fn kind(&self) -> usize {
        match self {
            Self::Sun { .. } => 0,
            Self::Point { .. } => 1,
            Self::Spot { .. } => 2,
            Self::Sphere { .. } => 3,
            Self::Disk { .. } => 4,
        }
    }
}

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
