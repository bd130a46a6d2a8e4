//! Further lobes of the BSDF: parameters at a hit, and the reflectance of a thin film.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::microfacet::{fresnel, refracted_cosine, schlick};

/// Further lobes, after the glTF extensions of [`canted_scene::Lobes`], at a hit.
///
/// ```text
/// sheen                fibers (Charlie)
/// clear coat           GGX reflection, ior 1.5
/// base                 the metallic-roughness model: anisotropic facets, a colored or iridescent reflection
/// ```
///
/// Each layer passes to the next what it does not reflect as a whole, by its albedo towards the viewer. So a white furnace stays
/// white for any base; the layers are not reciprocal, as the compensation of metals is not. Departures from glTF: the coat has the
/// shading normal of the base, and layers are seen from outside only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobes {
    /// Tint of the dielectric reflection at normal incidence.
    pub specular_color: [f32; 3],
    /// Strength of the clear coat, 0..=1.
    pub clearcoat: f32,
    /// Roughness of the coat, 0..=1.
    pub clearcoat_roughness: f32,
    /// Color of the fibers, 0..=1.
    pub sheen_color: [f32; 3],
    /// Roughness of the fibers, 0..=1.
    pub sheen_roughness: f32,
    /// Length of highlights along `direction`, 0..=1.
    pub anisotropy: f32,
    /// Unit vector in the plane of the surface, x and y of the local frame.
    pub direction: [f32; 2],
    /// Strength of the thin film, 0..=1.
    pub iridescence: f32,
    /// Index of refraction of the film.
    pub iridescence_ior: f32,
    /// Thickness of the film in nanometers.
    pub iridescence_thickness: f32,
    /// Absorption inside the solid, per unit of length.
    pub absorption: [f32; 3],
}

impl Default for Lobes {
    /// No further lobe.
    fn default() -> Self {
        Self {
            specular_color: [1.0; 3],
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            sheen_color: [0.0; 3],
            sheen_roughness: 0.0,
            anisotropy: 0.0,
            direction: [1.0, 0.0],
            iridescence: 0.0,
            iridescence_ior: 1.3,
            iridescence_thickness: 400.0,
            absorption: [0.0; 3],
        }
    }
}

impl Lobes {
    /// Whether there are layers over the base.
    pub(super) fn is_layered(&self) -> bool {
        self.clearcoat > 0.0 || self.sheen_color != [0.0; 3]
    }

    /// Whether the base reflects by an approximation of Fresnel's equations for a given reflectance at normal incidence.
    pub(super) fn is_colored(&self) -> bool {
        self.specular_color != [1.0; 3] || self.iridescence > 0.0
    }

    /// Reflectance of the dielectric base with this index of refraction, for `specular` 1.
    pub(super) fn dielectric(&self, cosine: f32, ior: f32) -> [f32; 3] {
        let normal = fresnel(1.0, ior).unwrap_or(1.0);
        let normal = self.specular_color.map(|c| (c * normal).min(1.0));
        self.film(cosine, normal, normal.map(|f| schlick(cosine, f)))
    }

    /// Reflectance of a base whose reflectance is `plain` without the film and `normal` at normal incidence.
    pub(super) fn film(&self, cosine: f32, normal: [f32; 3], plain: [f32; 3]) -> [f32; 3] {
        if self.iridescence == 0.0 {
            return plain;
        }
        let film = film_reflectance(self.iridescence_ior, cosine, self.iridescence_thickness, normal);
        let (film, plain) = (Vec3::from(film), Vec3::from(plain));
        (plain + self.iridescence * (film - plain)).into()
    }
}

// Interference in a thin film over a base. Source: Belcour and Barla 2017, *A Practical Extension to Microfacet Theory for the
// Modeling of Varying Iridescence*, with two orders of interference, as `KHR_materials_iridescence` recommends.

/// Reflectance of a film in air over a base of reflectance `base` at normal incidence, in 0..=1.
///
/// `thickness` is in nanometers. A film without thickness vanishes.
fn film_reflectance(ior: f32, cosine: f32, thickness: f32, base: [f32; 3]) -> [f32; 3] {
    // The film fades as it vanishes.
    let fade = (thickness / 0.03).clamp(0.0, 1.0);
    let ior = 1.0 + (ior - 1.0) * fade * fade * (3.0 - 2.0 * fade);
    let Some(inner) = refracted_cosine(cosine, ior) else { return [1.0; 3] };
    // Air to film.
    let outer = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let first = schlick(cosine, outer);
    let passed = 1.0 - first;
    let first_phase = if ior < 1.0 { PI } else { 0.0 };
    // Film to base: the index of the base is that which gives its reflectance in air.
    let base_ior = base.map(|f| {
        let root = f.clamp(0.0, 0.9999).sqrt();
        (1.0 + root) / (1.0 - root)
    });
    let second = base_ior.map(|n| schlick(inner, ((n - ior) / (n + ior)).powi(2)));
    let path = 2.0 * ior * thickness * inner;
    std::array::from_fn(|k| {
        let phase = PI - first_phase + if base_ior[k] < ior { PI } else { 0.0 };
        let both = (first * second[k]).clamp(1e-5, 0.9999);
        let amplitude = both.sqrt();
        // The reflectance after all orders, then the interference of the first two.
        let share = passed * passed * second[k] / (1.0 - both);
        let mut sum = first + share;
        let mut factor = share - passed;
        for order in 1..=2_u8 {
            let order = f32::from(order);
            factor *= amplitude;
            sum += 2.0 * factor * sensitivity(order * path, order * phase)[k];
        }
        sum.clamp(0.0, 1.0)
    })
}

/// The eye's response to the interference at a difference of path length in nanometers and of phase, in linear sRGB: the Fourier
/// transform of Gaussians that approximate the color matching functions.
fn sensitivity(path: f32, phase: f32) -> [f32; 3] {
    /// Height, position and variance of the Gaussians of X, Y and Z.
    const GAUSSIANS: [(f32, f32, f32); 3] =
        [(5.4856e-13, 1.6810e6, 4.3278e9), (4.4201e-13, 1.7953e6, 9.3046e9), (5.2481e-13, 2.2084e6, 6.6121e9)];
    /// The second one of X.
    const SECOND: (f32, f32, f32) = (9.7470e-14, 2.2399e6, 4.5282e9);
    /// Of X, Y and Z without interference.
    const NORM: f32 = 1.0685e-7;
    const RGB_FROM_XYZ: [[f32; 3]; 3] =
        [[3.2404542, -1.5371385, -0.4985314], [-0.969_266, 1.8760108, 0.041_556], [0.0556434, -0.2040259, 1.0572252]];
    let phase_of_path = TAU * path * 1e-9;
    let gaussian = |(height, position, variance): (f32, f32, f32)| {
        let spread = (TAU * variance).sqrt() * (-phase_of_path * phase_of_path * variance).exp();
        height * spread * (position * phase_of_path + phase).cos()
    };
    let mut xyz = GAUSSIANS.map(gaussian);
    xyz[0] += gaussian(SECOND);
    let xyz = xyz.map(|x| x / NORM);
    RGB_FROM_XYZ.map(|row| row.iter().zip(xyz).map(|(m, x)| m * x).sum())
}
