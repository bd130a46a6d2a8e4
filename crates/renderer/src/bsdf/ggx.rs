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

/// A GGX distribution, isotropic or with a width each for x and y.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ggx {
    /// Along y.
    alpha: f32,
    /// Along x.
    along: f32,
}

impl Ggx {
    /// The distribution for glTF roughness, `alpha = roughness²`; `None` for a perfect mirror.
    pub(super) fn of_roughness(roughness: f32) -> Option<Self> {
        let alpha = roughness * roughness;
        (alpha >= MIN_ALPHA).then_some(Self { alpha, along: alpha })
    }

    /// The distribution with longer highlights along x, as in `KHR_materials_anisotropy`.
    pub(super) fn stretched(self, anisotropy: f32) -> Self {
        Self { along: self.alpha + (1.0 - self.alpha) * anisotropy * anisotropy, ..self }
    }

    /// The roughness of the isotropic distribution that loses about as much light in a direction.
    pub(super) fn effective_roughness(self, [x, y, _]: [f32; 3]) -> f32 {
        let square = x * x + y * y;
        let (along, across) = (self.along * self.along, self.alpha * self.alpha);
        let mean = 0.5 * (along + across);
        // Towards the horizon masking depends on the width in the direction, at the zenith on both.
        let of_direction = if square > 0.0 { (along * x * x + across * y * y) / square } else { mean };
        (mean + (of_direction - mean) * square).sqrt().sqrt()
    }

    /// The part of the light that white facets reflect to a direction, for distributions without a fit: the mean over visible normals.
    pub(super) fn albedo(self, outgoing: [f32; 3]) -> f32 {
        const N: u16 = 144;
        /// Fibonacci's lattice: 89 and 144 are neighbors in his sequence.
        const STEPS: [f32; 2] = [1.0 / 144.0, 89.0 / 144.0];
        let reflected = |i: u16| {
            let square = STEPS.map(|step| ((0.5 + f32::from(i)) * step).fract());
            let incident = reflect(outgoing, self.sample(outgoing, square));
            // Value over density.
            if incident[2] <= 0.0 {
                0.0
            } else {
                2.0 * self.masking(outgoing, incident) * (outgoing[2] + self.root(outgoing))
            }
        };
        (0..N).map(reflected).sum::<f32>() / f32::from(N)
    }

    /// Whether there is one width for all directions.
    pub(super) fn is_isotropic(self) -> bool {
        self.along == self.alpha
    }

    /// Density of facet normals, `D`.
    pub(super) fn distribution(self, [x, y, z]: [f32; 3]) -> f32 {
        // The tangent over alpha from the components: 1 - z² would cancel for a narrow lobe.
        let (x, y) = (x / self.along, y / self.alpha);
        let square = x * x + y * y + z * z;
        1.0 / (PI * self.along * self.alpha * square * square)
    }

    /// Masking-shadowing `G₂ / (4·cosθo)`; `incident` has a positive cosine, too.
    ///
    /// Source: Heitz 2014, height-correlated, divided by the cosines analytically so that no small cosine overflows.
    pub(super) fn masking(self, outgoing: [f32; 3], incident: [f32; 3]) -> f32 {
        0.5 / (self.root(outgoing) + outgoing[2] / incident[2] * self.root(incident))
    }

    /// PDF of [`Self::sample`] over the cosine between `outgoing` and the facet, per steradian of facet normals:
    /// `G₁·D / cosθo`.
    pub(super) fn density(self, outgoing: [f32; 3], normal: [f32; 3]) -> f32 {
        2.0 * self.distribution(normal) / (outgoing[2] + self.root(outgoing))
    }

    /// Samples a visible normal (Heitz 2018), from a point of the unit square.
    ///
    /// In the hemispherical configuration, visible normals reflect `outgoing` into a spherical cap, uniformly (Dupuy
    /// and Benyoub 2023).
    pub(super) fn sample(self, outgoing: [f32; 3], square: [f32; 2]) -> [f32; 3] {
        let [x, y, z] = outgoing;
        let from = unit([self.along * x, self.alpha * y, z]);
        // The cap extends from the pole to -from.z; this is (1 - ξ)(1 + from.z) above its base.
        let (above, depth) = ((1.0 - square[1]) * (1.0 + from[2]), square[1] * (1.0 + from[2]));
        // (1 + z)(1 - z) of the direction, without cancellation.
        let sine = ((above + (1.0 - from[2])) * depth).sqrt();
        let (s, c) = (TAU * square[0]).sin_cos();
        unit([self.along * (sine * c + from[0]), self.alpha * (sine * s + from[1]), above])
    }

    /// `cosθ·√(1 + α²·tan²θ)`, a term of Smith's masking function.
    fn root(self, [x, y, cosine]: [f32; 3]) -> f32 {
        let square = self.alpha * self.alpha;
        if self.is_isotropic() {
            return (square + (1.0 - square) * cosine * cosine).sqrt();
        }
        (cosine * cosine + self.along * self.along * x * x + square * y * y).sqrt()
    }
}

/// Mirrors `outgoing` at a facet normal.
pub(super) fn reflect(outgoing: [f32; 3], normal: [f32; 3]) -> [f32; 3] {
    let twice = 2.0 * dot(outgoing, normal);
    std::array::from_fn(|k| twice * normal[k] - outgoing[k])
}
