/// A ray cone: the width of the region around a ray that a sample represents. It determines the texture footprint.
///
/// Source: Akenine-Möller et al. 2019 ("Texture level of detail strategies for real-time ray tracing"), with two
/// changes:
///
/// * Sample number `i` of a pixel has a cone `1/√(i + 1)` times as wide as the pixel. A single sample covers its pixel;
///   with many samples, texture blur vanishes and the image converges to the unfiltered one. The number of a sample is
///   known even if their count is not, so partial renders can be merged.
/// * Scattering widens the cone by the solid angle that a direction represents, the reciprocal of its PDF (Colbert and
///   Křivánek 2007), at most `π`, that of a diffuse surface. Rough surfaces widen the cone, mirrors do not.
///
/// The curvature of mirrors is ignored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Diameter at the origin of the ray, world units.
    width: f64,
    /// Growth of the diameter with distance.
    spread: f64,
    /// Width relative to the full pixel or scattering lobe.
    scale: f64,
    /// Whether only mirrors lie between the ray and the camera.
    is_direct: bool,
}

impl Cone {
    /// Zero width: textures are looked up at full resolution, also after scattering.
    pub const ZERO: Self = Self { width: 0.0, spread: 0.0, scale: 0.0, is_direct: true };

    /// The cone of a pixel's sample with this number; `width` and `spread` are those of the pixel.
    pub(crate) fn of_pixel(width: f64, spread: f64, sample: u32) -> Self {
        let scale = 1.0 / (f64::from(sample) + 1.0).sqrt();
        Self { width: width * scale, spread: spread * scale, scale, is_direct: true }
    }

    /// The cone further along the ray, by a distance in world units.
    #[must_use]
    pub fn grown(self, distance: f64) -> Self {
        Self { width: self.width + self.spread * distance, ..self }
    }

    /// The cone after scattering into a direction sampled with a finite PDF, per steradian.
    ///
    /// Do not call this for delta lobes, which keep the cone.
    #[must_use]
    pub fn scattered(self, density: f32) -> Self {
        let solid_angle = (1.0 / f64::from(density)).min(std::f64::consts::PI);
        let spread = (self.spread * self.spread + solid_angle * self.scale * self.scale).sqrt();
        Self { spread, is_direct: false, ..self }
    }

    /// Diameter, world units.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Whether the width is zero, so that lookups need no filter.
    pub(crate) fn is_zero(&self) -> bool {
        self.width == 0.0
    }

    pub(crate) fn is_direct(&self) -> bool {
        self.is_direct
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cones_grow_with_distance_and_shrink_with_sample_number() {
        assert_eq!(Cone::of_pixel(1.0, 0.5, 0).grown(4.0).width(), 3.0);
        assert_eq!(Cone::of_pixel(1.0, 0.5, 3).grown(4.0).width(), 1.5);
        assert_eq!(Cone::ZERO.grown(1e9).scattered(0.1).grown(1e9).width(), 0.0);
    }

    #[test]
    fn scattering_widens_by_inverse_pdf_up_to_diffuse() {
        let width = |density: f32| Cone::of_pixel(1.0, 0.0, 0).scattered(density).grown(1.0).width();
        assert_eq!(width(100.0), 1.1);
        for density in [0.0, 1e-30, 0.1] {
            assert_eq!(width(density), 1.0 + std::f64::consts::PI.sqrt(), "{density}");
        }
        assert!(!Cone::ZERO.scattered(1.0).is_direct());
    }
}
