//! Interference in a thin film over a base. Source: Belcour and Barla 2017, *A Practical Extension to Microfacet Theory for the
//! Modeling of Varying Iridescence*, with two orders of interference, as `KHR_materials_iridescence` recommends.

use std::f32::consts::{PI, TAU};

use super::fresnel::{refracted_cosine, schlick};

/// Reflectance of a film in air over a base of reflectance `base` at normal incidence, in 0..=1.
///
/// `thickness` is in nanometers. A film without thickness vanishes.
pub(super) fn reflectance(ior: f32, cosine: f32, thickness: f32, base: [f32; 3]) -> [f32; 3] {
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
