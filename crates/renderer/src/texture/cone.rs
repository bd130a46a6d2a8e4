/// The part of space that a ray stands for: a narrow cone about it, whose width decides how much of a texture it sees.
///
/// After Akenine-Möller et al. 2019 ("Texture level of detail strategies for real-time ray tracing"), but for two choices:
///
/// * The cone of sample number `i` of a pixel is narrower than the pixel by `1/√(i + 1)`. One sample stands for its pixel;
///   many share it, and what they blur each goes to nothing as their number grows: the picture tends to that without any
///   averaging. The number of a sample is known where their count is not, so parts of a picture still join.
/// * Scattering opens the cone by the solid angle that one direction stands for, the reciprocal of its density (as Colbert and
///   Křivánek 2007 choose), at most `π`: that of a diffuse surface. So rough surfaces open it and mirrors leave it as it is.
///
/// The curvature of mirrors is not followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Diameter at the origin of the ray, world units.
    width: f64,
    /// Growth of the diameter with distance.
    spread: f64,
    /// The part of a pixel, or of what a surface scatters to, that the sample stands for: a ratio of lengths.
    share: f64,
    /// Whether nothing but mirrors lies between the ray and the camera.
    is_direct: bool,
}

impl Cone {
    /// A ray without width, before and after scattering: textures are looked up at full size.
    pub const ZERO: Self = Self { width: 0.0, spread: 0.0, share: 0.0, is_direct: true };

    /// The cone of a pixel's sample with this number: `width` and `spread` are those of the pixel.
    pub(crate) fn of_pixel(width: f64, spread: f64, sample: u32) -> Self {
        let share = 1.0 / (f64::from(sample) + 1.0).sqrt();
        Self { width: width * share, spread: spread * share, share, is_direct: true }
    }

    /// The same cone further along the ray, by world units.
    #[must_use]
    pub fn grown(self, distance: f64) -> Self {
        Self { width: self.width + self.spread * distance, ..self }
    }

    /// The cone about a direction that a surface scattered to, which was chosen with a finite density, per steradian.
    ///
    /// Mirrors and clear boundaries leave the cone as it is.
    #[must_use]
    pub fn scattered(self, density: f32) -> Self {
        let solid_angle = (1.0 / f64::from(density)).min(std::f64::consts::PI);
        let spread = (self.spread * self.spread + solid_angle * self.share * self.share).sqrt();
        Self { spread, is_direct: false, ..self }
    }

    /// Diameter where the cone is, world units.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Whether it has no width, so that a point is all that is seen.
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
    fn cones_grow_with_distance_and_narrow_with_the_number_of_the_sample() {
        assert_eq!(Cone::of_pixel(1.0, 0.5, 0).grown(4.0).width(), 3.0);
        assert_eq!(Cone::of_pixel(1.0, 0.5, 3).grown(4.0).width(), 1.5);
        assert_eq!(Cone::ZERO.grown(1e9).scattered(0.1).grown(1e9).width(), 0.0);
    }

    #[test]
    fn scattering_opens_by_the_reciprocal_of_the_density_and_at_most_like_a_diffuse_surface() {
        let width = |density: f32| Cone::of_pixel(1.0, 0.0, 0).scattered(density).grown(1.0).width();
        assert_eq!(width(100.0), 1.1);
        for density in [0.0, 1e-30, 0.1] {
            assert_eq!(width(density), 1.0 + std::f64::consts::PI.sqrt(), "{density}");
        }
        assert!(!Cone::ZERO.scattered(1.0).is_direct());
    }
}
