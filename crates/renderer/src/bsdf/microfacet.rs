//! The GGX microfacet distribution (Trowbridge and Reitz 1975, Walter et al. 2007) with height-correlated Smith
//! masking.
//!
//! Directions are unit vectors in the local frame; `outgoing` and facet normals have positive z.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

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

    /// The distribution with longer highlights along x, as in `KHR_materials_anisotropy`; `None` for a perfect mirror, which is smooth along
    /// both axes. A surface that is smooth across the highlights alone has the least width there.
    pub(super) fn stretched(roughness: f32, anisotropy: f32) -> Option<Self> {
        let alpha = roughness * roughness;
        let along = alpha + (1.0 - alpha) * anisotropy * anisotropy;
        (along >= MIN_ALPHA).then_some(Self { alpha: alpha.max(MIN_ALPHA), along })
    }

    /// The roughness of the isotropic distribution that loses about as much light in a direction.
    pub(super) fn effective_roughness(self, Vec3 { x, y, .. }: Vec3) -> f32 {
        let square = x * x + y * y;
        let (along, across) = (self.along * self.along, self.alpha * self.alpha);
        let mean = 0.5 * (along + across);
        // Towards the horizon masking depends on the width in the direction, at the zenith on both.
        let of_direction = if square > 0.0 { (along * x * x + across * y * y) / square } else { mean };
        (mean + (of_direction - mean) * square).sqrt().sqrt()
    }

    /// The part of the light that white facets reflect to a direction, for distributions without a fit: the mean over visible normals.
    pub(super) fn albedo(self, outgoing: Vec3) -> f32 {
        const N: u16 = 144;
        /// Fibonacci's lattice: 89 and 144 are neighbors in his sequence.
        const STEPS: [f32; 2] = [1.0 / 144.0, 89.0 / 144.0];
        let reflected = |i: u16| {
            let square = STEPS.map(|step| ((0.5 + f32::from(i)) * step).fract());
            self.passed(outgoing, reflect(outgoing, self.sample(outgoing, square)))
        };
        (0..N).map(reflected).sum::<f32>() / f32::from(N)
    }

    /// The part of the light from `incident` that other facets do not block on the way from the sampled facet: value over density. 0 from
    /// below the horizon.
    pub(super) fn passed(self, outgoing: Vec3, incident: Vec3) -> f32 {
        if incident.z <= 0.0 {
            0.0
        } else {
            2.0 * self.masking(outgoing, incident) * (outgoing.z + self.root(outgoing))
        }
    }

    /// Whether there is one width for all directions.
    pub(super) fn is_isotropic(self) -> bool {
        self.along == self.alpha
    }

    /// Density of facet normals, `D`.
    pub(super) fn distribution(self, Vec3 { x, y, z }: Vec3) -> f32 {
        // The tangent over alpha from the components: 1 - z² would cancel for a narrow lobe.
        let (x, y) = (x / self.along, y / self.alpha);
        let square = x * x + y * y + z * z;
        1.0 / (PI * self.along * self.alpha * square * square)
    }

    /// Masking-shadowing `G₂ / (4·cosθo)`; `incident` has a positive cosine, too.
    ///
    /// Source: Heitz 2014, height-correlated, divided by the cosines analytically so that no small cosine overflows.
    pub(super) fn masking(self, outgoing: Vec3, incident: Vec3) -> f32 {
        0.5 / (self.root(outgoing) + outgoing.z / incident.z * self.root(incident))
    }

    /// PDF of [`Self::sample`] over the cosine between `outgoing` and the facet, per steradian of facet normals:
    /// `G₁·D / cosθo`.
    pub(super) fn density(self, outgoing: Vec3, normal: Vec3) -> f32 {
        2.0 * self.distribution(normal) / (outgoing.z + self.root(outgoing))
    }

    /// Samples a visible normal (Heitz 2018), from a point of the unit square.
    ///
    /// In the hemispherical configuration, visible normals reflect `outgoing` into a spherical cap, uniformly (Dupuy
    /// and Benyoub 2023).
    pub(super) fn sample(self, outgoing: Vec3, square: [f32; 2]) -> Vec3 {
        let stretch = Vec3::new(self.along, self.alpha, 1.0);
        let from = unit(stretch * outgoing);
        // The cap extends from the pole to -from.z; this is (1 - ξ)(1 + from.z) above its base.
        let (above, depth) = ((1.0 - square[1]) * (1.0 + from.z), square[1] * (1.0 + from.z));
        // (1 + z)(1 - z) of the direction, without cancellation.
        let sine = ((above + (1.0 - from.z)) * depth).sqrt();
        let (s, c) = (TAU * square[0]).sin_cos();
        unit(stretch * Vec3::new(sine * c + from.x, sine * s + from.y, above))
    }

    /// `cosθ·√(1 + α²·tan²θ)`, a term of Smith's masking function.
    fn root(self, Vec3 { x, y, z: cosine }: Vec3) -> f32 {
        let square = self.alpha * self.alpha;
        if self.is_isotropic() {
            return (square + (1.0 - square) * cosine * cosine).sqrt();
        }
        (cosine * cosine + self.along * self.along * x * x + square * y * y).sqrt()
    }
}

/// Mirrors `outgoing` at a facet normal.
pub(super) fn reflect(outgoing: Vec3, normal: Vec3) -> Vec3 {
    2.0 * outgoing.dot(normal) * normal - outgoing
}

/// Normalizes `v`, which is not zero.
///
/// Scales by the largest component first, because half vectors near the horizon may be too short to be squared. Divides, which
/// rounds once where `glam` rounds twice.
pub(super) fn unit(v: Vec3) -> Vec3 {
    let v = v / v.abs().max_element();
    v / v.length()
}

/// Mean of the channels.
pub(super) fn mean(color: [f32; 3]) -> f32 {
    (color[0] + color[1] + color[2]) / 3.0
}

// Fresnel reflectance.

/// Fresnel reflectance of unpolarized light at a dielectric boundary; `None` for total internal reflection.
///
/// `cosine` in 0..=1 is on the side from which the light comes, `eta` the index of refraction of the far side over that
/// side's.
pub(super) fn fresnel(cosine: f32, eta: f32) -> Option<f32> {
    let refracted = refracted_cosine(cosine, eta)?;
    let perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    let parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    Some(0.5 * (perpendicular * perpendicular + parallel * parallel))
}

/// Cosine of the refracted direction by Snell's law; `None` for total internal reflection.
pub(super) fn refracted_cosine(cosine: f32, eta: f32) -> Option<f32> {
    // eta² - sin²θ without cancellation: above 45 degrees eta may be near 1, below it may be small.
    let square = if cosine * cosine < 0.5 {
        (eta - 1.0) * (eta + 1.0) + cosine * cosine
    } else {
        eta * eta - (1.0 - cosine) * (1.0 + cosine)
    };
    (square > 0.0).then(|| square.sqrt() / eta)
}

/// Schlick's approximation (1994) for a conductor with reflectance `normal` at normal incidence.
pub(super) fn schlick(cosine: f32, normal: f32) -> f32 {
    let sine = 1.0 - cosine;
    let square = sine * sine;
    normal + (1.0 - normal) * square * square * sine
}

/// A lower bound of the cosine-weighted mean of [`fresnel`] over the hemisphere, within 0.012 for `eta` in 1..=4.
///
/// A lower bound keeps the sum of base and coat below 1 even though roughness raises the reflectance of the coat above
/// that of a flat one (measured: by at most 0.0007 for `eta` up to 4). Above 4 the increase is large at Brewster's
/// angle, and the bound stays at its value for 4.
pub(super) fn mean_fresnel_below(eta: f32) -> f32 {
    let eta = eta.clamp(1.02, 4.0);
    (eta - 1.02) / (eta + 4.25)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the angles of both rays, in `f64`; not at normal incidence, where this divides by zero.
    fn by_angles(angle: f64, eta: f64) -> f64 {
        let sine = angle.sin() / eta;
        if sine >= 1.0 {
            return 1.0;
        }
        let refracted = sine.asin();
        let perpendicular = (angle - refracted).sin() / (angle + refracted).sin();
        let parallel = (angle - refracted).tan() / (angle + refracted).tan();
        (perpendicular.powi(2) + parallel.powi(2)) / 2.0
    }

    #[test]
    fn dielectric_matches_angle_formula() {
        for eta in [1.0001, 1.33, 1.5, 2.4, 1.0 / 1.5, 1.0 / 2.4] {
            for degree in 1..90 {
                let angle = f64::from(degree).to_radians();
                let got = fresnel(angle.cos() as f32, eta as f32).unwrap_or(1.0);
                // The reflectance is steepest near the horizon and the critical angle: at whole degrees it amplifies an
                // error of the cosine or of eta by at most 200.
                let want = by_angles(angle, f64::from(eta as f32));
                assert!(
                    (f64::from(got) - want).abs() < 200.0 * f64::from(f32::EPSILON),
                    "{eta} {degree}: {got} {want}"
                );
            }
        }
        assert_eq!(fresnel(0.7, 1.0), Some(0.0));
        assert_eq!((fresnel(0.0, 1.5), fresnel(0.1, 1.0 / 1.5)), (Some(1.0), None));
        assert_eq!((schlick(1.0, 0.25), schlick(0.0, 0.25)), (0.25, 1.0));
    }

    #[test]
    fn mean_is_a_tight_lower_bound() {
        const STEPS: u32 = 10_000;
        let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt() as f32;
        for eta in [1.0001, 1.001, 1.01, 1.02, 1.05, 1.1, 1.2, 1.33, 1.5, 2.0, 2.4, 3.0, 4.0] {
            let reflectance = |i| fresnel(at(i), eta).map_or(1.0, f64::from);
            let mean = (0..STEPS).map(reflectance).sum::<f64>() / f64::from(STEPS);
            let below = f64::from(mean_fresnel_below(eta));
            assert!(below < mean && mean - below < 0.012, "{eta}: {below} for {mean}");
        }
    }
}
