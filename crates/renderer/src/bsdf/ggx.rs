//! The GGX microfacet distribution (Trowbridge and Reitz 1975, Walter et al. 2007) with height-correlated Smith
//! masking.
//!
//! Directions are unit vectors in the local frame; `outgoing` and facet normals have positive z.

use std::f32::consts::{PI, TAU};

use super::vector::{dot, unit};

/// The minimum `alpha`; smoother boundaries are perfect mirrors.
///
/// The half vector of two unit vectors in `f32` has an error of about 2⁻²³ rad, which changes the distribution at this
/// width by 2⁻¹² of its value, and by more for narrower lobes. The lobe is 2⁻⁹ rad wide, a tenth of a degree: two pixels
/// of an image 1000 pixels and 60 degrees wide.
pub(super) const MIN_ALPHA: f32 = 1.0 / 1024.0;

/// An isotropic GGX distribution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ggx {
    alpha: f32,
}

impl Ggx {
    /// The distribution for glTF roughness, `alpha = roughness²`; `None` for a perfect mirror.
    pub(super) fn of_roughness(roughness: f32) -> Option<Self> {
        let alpha = roughness * roughness;
        (alpha >= MIN_ALPHA).then_some(Self { alpha })
    }

    /// Density of facet normals, `D`.
    pub(super) fn distribution(self, [x, y, z]: [f32; 3]) -> f32 {
        // The tangent over alpha from the components: 1 - z² would cancel for a narrow lobe.
        let (x, y) = (x / self.alpha, y / self.alpha);
        let square = x * x + y * y + z * z;
        1.0 / (PI * self.alpha * self.alpha * square * square)
    }

    /// Masking-shadowing `G₂ / (4·cosθo)`, for positive cosines.
    ///
    /// Source: Heitz 2014, height-correlated, divided by the cosines analytically so that no small cosine overflows.
    pub(super) fn masking(self, outgoing: f32, incident: f32) -> f32 {
        0.5 / (self.root(outgoing) + outgoing / incident * self.root(incident))
    }

    /// PDF of [`Self::sample`] over the cosine between `outgoing` and the facet, per steradian of facet normals:
    /// `G₁·D / cosθo`.
    pub(super) fn density(self, outgoing: f32, normal: [f32; 3]) -> f32 {
        2.0 * self.distribution(normal) / (outgoing + self.root(outgoing))
    }

    /// Samples a visible normal (Heitz 2018), from a point of the unit square.
    ///
    /// In the hemispherical configuration, visible normals reflect `outgoing` into a spherical cap, uniformly (Dupuy
    /// and Benyoub 2023).
    pub(super) fn sample(self, outgoing: [f32; 3], square: [f32; 2]) -> [f32; 3] {
        let [x, y, z] = outgoing;
        let from = unit([self.alpha * x, self.alpha * y, z]);
        // The cap extends from the pole to -from.z; this is (1 - ξ)(1 + from.z) above its base.
        let (above, depth) = ((1.0 - square[1]) * (1.0 + from[2]), square[1] * (1.0 + from[2]));
        // (1 + z)(1 - z) of the direction, without cancellation.
        let sine = ((above + (1.0 - from[2])) * depth).sqrt();
        let (s, c) = (TAU * square[0]).sin_cos();
        unit([self.alpha * (sine * c + from[0]), self.alpha * (sine * s + from[1]), above])
    }

    /// `cosθ·√(1 + α²·tan²θ)`, a term of Smith's masking function.
    fn root(self, cosine: f32) -> f32 {
        let square = self.alpha * self.alpha;
        (square + (1.0 - square) * cosine * cosine).sqrt()
    }
}

/// Mirrors `outgoing` at a facet normal.
pub(super) fn reflect(outgoing: [f32; 3], normal: [f32; 3]) -> [f32; 3] {
    let twice = 2.0 * dot(outgoing, normal);
    std::array::from_fn(|k| twice * normal[k] - outgoing[k])
}
