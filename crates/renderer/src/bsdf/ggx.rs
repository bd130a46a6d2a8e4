//! Microfacets after Trowbridge and Reitz 1975 ("GGX", Walter et al. 2007) with Smith's height-correlated masking.
//!
//! Directions are unit vectors in the local frame, `outgoing` and facet normals with z above 0.

use std::f32::consts::{PI, TAU};

use super::vector::{dot, unit};

/// The least `alpha` with a width; a boundary below it is a mirror.
///
/// Two unit vectors rounded to `f32` give their half vector to about 2⁻²³ rad, which changes the distribution by 2⁻¹²
/// of itself at this width, and the more the narrower it is. The lobe is then 2⁻⁹ rad wide, a tenth of a degree: two
/// pixels of a picture 1000 pixels and 60 degrees across.
pub(super) const MIN_ALPHA: f32 = 1.0 / 1024.0;

/// Facets whose slopes have the width `alpha`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ggx {
    alpha: f32,
}

impl Ggx {
    /// Facets of glTF's roughness, `alpha = roughness²`; `None` for a mirror.
    pub(super) fn of_roughness(roughness: f32) -> Option<Self> {
        let alpha = roughness * roughness;
        (alpha >= MIN_ALPHA).then_some(Self { alpha })
    }

    /// Area of facets about `normal`, per steradian and area of the surface.
    pub(super) fn distribution(self, [x, y, z]: [f32; 3]) -> f32 {
        // The tangent over alpha, from the components: 1 - z² would lose all digits of a narrow lobe.
        let (x, y) = (x / self.alpha, y / self.alpha);
        let square = x * x + y * y + z * z;
        1.0 / (PI * self.alpha * self.alpha * square * square)
    }

    /// Masking and shadowing over four outgoing cosines, `G₂ / (4·cosθo)`; both cosines are above 0.
    ///
    /// The height-correlated form of Heitz 2014 with the quotient of cosines taken out, so that no cosine however
    /// small overflows.
    pub(super) fn masking(self, outgoing: f32, incident: f32) -> f32 {
        0.5 / (self.root(outgoing) + outgoing / incident * self.root(incident))
    }

    /// Density of [`Self::sample`] over the cosine between `outgoing` and the facet, per steradian of facet normals:
    /// `G₁·D / cosθo`.
    pub(super) fn density(self, outgoing: f32, normal: [f32; 3]) -> f32 {
        2.0 * self.distribution(normal) / (outgoing + self.root(outgoing))
    }

    /// A facet normal as `outgoing` sees them (Heitz 2018), from a point of the unit square.
    ///
    /// The facets of a unit hemisphere that are seen reflect into a cap of the sphere in which directions are uniform
    /// (Dupuy and Benyoub 2023); the ellipsoid of facets is that hemisphere stretched.
    pub(super) fn sample(self, outgoing: [f32; 3], square: [f32; 2]) -> [f32; 3] {
        let [x, y, z] = outgoing;
        let from = unit([self.alpha * x, self.alpha * y, z]);
        // The cap reaches from the pole to -from.z; its height is (1 - ξ)(1 + from.z) above that.
        let (above, depth) = ((1.0 - square[1]) * (1.0 + from[2]), square[1] * (1.0 + from[2]));
        // (1 + z)(1 - z) of the direction, each factor without cancellation.
        let sine = ((above + (1.0 - from[2])) * depth).sqrt();
        let (s, c) = (TAU * square[0]).sin_cos();
        unit([self.alpha * (sine * c + from[0]), self.alpha * (sine * s + from[1]), above])
    }

    /// `cosθ·√(1 + α²·tan²θ)`: what Smith's integral has in place of a cosine.
    fn root(self, cosine: f32) -> f32 {
        let square = self.alpha * self.alpha;
        (square + (1.0 - square) * cosine * cosine).sqrt()
    }
}

/// The direction that a facet mirrors `outgoing` into.
pub(super) fn reflect(outgoing: [f32; 3], normal: [f32; 3]) -> [f32; 3] {
    let twice = 2.0 * dot(outgoing, normal);
    std::array::from_fn(|k| twice * normal[k] - outgoing[k])
}
