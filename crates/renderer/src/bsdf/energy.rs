//! What rough boundaries lose by multiple scattering, and what gives it back.
//!
//! A microfacet model follows light to one facet. What the next facet blocks is lost: of a white metal with roughness 1, half to
//! two thirds. Let `E(μ, r)` be the albedo of white facets at the cosine `μ` and the roughness `r`.
//!
//! * **Metal** (Turquin 2019, *Practical multiple scattering compensation for microfacet models*): its reflection is multiplied by
//!   `1 + c·(1 - E)/E` with the base color `c`, so that white metal reflects everything. The shape of the lobe is kept.
//! * **Coat** over a diffuse base: it reflects `R(μ) = E(μ, r)·F(μ')`, where `F` is Fresnel's reflectance and `μ'` the mean
//!   cosine between light and facets. The base gets what the coat does not reflect, `(1 - R(μo))·(1 - R(μi)) / (1 - R̄)`
//!   (Kelemen and Szirmay-Kalos 2001), in place of the reflectances of a smooth coat.
//! * **Thin walls** transmit what they do not reflect.
//! * **Rough glass** that refracts: reflection and refraction are divided by their sum for white glass, as a function of the direction to the
//!   viewer, the roughness, the index of refraction and the side (`glass`).
//!
//! The factors of metal, thin walls and glass depend on the direction to the viewer only, so these lobes are not reciprocal.
//!
//! # Fits
//!
//! `E`, `μ'` and `R̄` are polynomials, fitted to means over 96 x 96 visible normals at roughness 1/32 to 1. `E` is within 0.6 % of
//! them at all cosines, `R` within 0.015 for indices of refraction from 1.35 to 2. The variable of the cosine is the root of
//! `μ(1 + α)/(μ + α)`, which resolves grazing angles, where the albedo of narrow lobes changes fastest.
//!
//! `shared/bsdf.wgsl` has the same coefficients.

/// Coefficients of [`Energy::albedo`]: a row for each power of `s`, a column for each power of the roughness.
const ALBEDO: [[f32; 5]; 7] = [
    [0.99442667, -0.0046965606, 0.041189846, -0.09276388, 0.06731132],
    [0.3289856, 1.2405112, -5.7699223, 9.250136, -5.371819],
    [-4.063187, -21.58304, 96.69958, -139.5704, 68.386375],
    [17.811588, 113.0354, -503.92072, 678.4959, -308.38388],
    [-38.811775, -248.2274, 1138.2389, -1499.6288, 654.9688],
    [38.815273, 242.16681, -1155.6523, 1522.6134, -653.48334],
    [-14.06146, -87.00478, 432.94437, -577.06775, 246.90771],
];

/// Coefficients of [`Energy::effective_cosine`], likewise.
const COSINE: [[f32; 5]; 5] = [
    [4.7165737, -18.228926, 36.795284, -35.958527, 13.18787],
    [0.17437683, -1.5628386, 4.650756, -5.6139894, 2.3578134],
    [-4.4519277, 26.359417, -66.78361, 72.839836, -27.975342],
    [5.701652, -49.421364, 147.20836, -176.556, 72.33108],
    [-6.960863, 47.86098, -134.71822, 160.38995, -66.25904],
];

/// Coefficients of [`mean_coat`]: rows for the roughness, columns for `(eta - 1) / (eta + 1)`.
const MEAN: [[f32; 3]; 3] =
    [[1.3273436, -1.2267793, 1.2081856], [-1.7918327, 5.616328, -4.4670687], [0.44777808, -3.2862773, 2.5457828]];

/// The fits for one roughness in 0..=1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Energy {
    roughness: f32,
    /// Coefficients for each power of the variable of the cosine.
    albedo: [f32; ALBEDO.len()],
    cosine: [f32; COSINE.len()],
}

impl Energy {
    pub(super) fn new(roughness: f32) -> Self {
        let (mut albedo, mut cosine) = ([0.0; ALBEDO.len()], [0.0; COSINE.len()]);
        for (sum, row) in albedo.iter_mut().zip(&ALBEDO) {
            *sum = polynomial(row, roughness);
        }
        for (sum, row) in cosine.iter_mut().zip(&COSINE) {
            *sum = polynomial(row, roughness);
        }
        Self { roughness, albedo, cosine }
    }

    /// Albedo of white facets with single scattering, at a cosine.
    pub(super) fn albedo(&self, cosine: f32) -> f32 {
        self.albedo_at(self.variable(cosine))
    }

    /// The cosine at which Fresnel's reflectance is the mean over the facets that reflect light to a direction.
    pub(super) fn effective_cosine(&self, cosine: f32) -> f32 {
        self.effective_at(cosine, self.variable(cosine))
    }

    /// [`Energy::albedo`] and [`Energy::effective_cosine`].
    pub(super) fn both(&self, cosine: f32) -> [f32; 2] {
        let variable = self.variable(cosine);
        [self.albedo_at(variable), self.effective_at(cosine, variable)]
    }

    fn albedo_at(&self, variable: f32) -> f32 {
        polynomial(&self.albedo, variable).clamp(0.2, 1.0)
    }

    fn effective_at(&self, cosine: f32, variable: f32) -> f32 {
        let shift = polynomial(&self.cosine, variable);
        (cosine + self.roughness * self.roughness * shift).clamp(0.0, 1.0)
    }

    fn variable(&self, cosine: f32) -> f32 {
        let alpha = self.roughness * self.roughness;
        (cosine * (1.0 + alpha) / (cosine + alpha)).sqrt()
    }

    /// Cosine-weighted mean over the hemisphere of what a rough coat reflects; constant for `eta` above 4, as that of a smooth coat.
    pub(super) fn mean_coat(&self, eta: f32) -> f32 {
        let eta = eta.clamp(1.0, 4.0);
        let columns = MEAN.each_ref().map(|row| polynomial(row, (eta - 1.0) / (eta + 1.0)));
        polynomial(&columns, self.roughness) * (eta - 1.0) / (eta + 4.25)
    }
}

fn polynomial<const N: usize>(coefficients: &[f32; N], x: f32) -> f32 {
    let mut sum = 0.0;
    for c in coefficients.iter().rev() {
        sum = sum * x + c;
    }
    sum
}
