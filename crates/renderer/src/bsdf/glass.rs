//! What rough glass scatters in total: a table, since no polynomial in cosine, roughness and index of refraction fits it.
//!
//! `shared/bsdf.wgsl` reads the same table.

use std::sync::LazyLock;

use glam::Vec3;

use super::microfacet::{Ggx, fresnel, reflect, refracted_cosine, unit};

/// Entries along each axis: sides of the boundary, indices of refraction, roughnesses, cosines. Between them the table errs by 0.4 % in the
/// mean; by 2 % for the narrowest lobes near the horizon, and by 5 % there from inside of media of an index below 1.05.
const N_IORS: usize = 16;
const N_ROUGHNESSES: usize = 12;
const N_COSINES: usize = 12;

/// The least roughness, below which boundaries are mirrors.
const MIN_ROUGHNESS: f32 = 1.0 / 32.0;

/// The least index of refraction of an entry; for smaller ones, light passes straight.
const MIN_IOR: f32 = 1.0 + 1.0 / 128.0;

/// The greatest one.
const MAX_IOR: f32 = 1000.0;

/// The least cosine of an entry.
const MIN_COSINE: f32 = 1e-4;

/// Albedo of the facets of white glass without a reflection where it is not total, and what the whole reflection adds.
static TABLE: LazyLock<Vec<[f32; 2]>> = LazyLock::new(|| {
    let sides = [false, true].into_iter();
    let entries = sides.flat_map(|is_inside| (0..N_IORS).map(move |i| (is_inside, i)));
    let entries = entries.flat_map(|(is_inside, i)| (0..N_ROUGHNESSES).map(move |j| (is_inside, i, j)));
    let entries = entries.flat_map(|(is_inside, i, j)| (0..N_COSINES).map(move |k| (is_inside, i, j, k)));
    entries.map(|(is_inside, i, j, k)| entry(is_inside, [i, j, k])).collect()
});

/// The table, for kernels.
#[cfg(feature = "gpu")]
pub(crate) fn table() -> &'static [[f32; 2]] {
    &TABLE
}

/// The part of the light that the facets of white glass reflect and refract into a direction by single scattering, as energy: without the
/// scaling of radiance by refraction. `specular` is the strength of the reflection.
pub(super) fn albedo(cosine: f32, roughness: f32, ior: f32, is_inside: bool, specular: f32) -> f32 {
    let place = |x: f32, n: usize| {
        let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
        let first = (x as usize).min(n - 2);
        (first, x - first as f32)
    };
    let (i, of_ior) = place(((ior - 1.0) / (ior + 1.0)).sqrt(), N_IORS);
    let (j, of_roughness) = place((roughness - MIN_ROUGHNESS) / (1.0 - MIN_ROUGHNESS), N_ROUGHNESSES);
    let (k, of_cosine) = place(cosine.sqrt(), N_COSINES);
    let table = &*TABLE;
    let at = |i: usize, j: usize, k: usize| {
        let [through, reflected] = table[((usize::from(is_inside) * N_IORS + i) * N_ROUGHNESSES + j) * N_COSINES + k];
        through + specular * reflected
    };
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    let along_cosine = |i, j| mix(at(i, j, k), at(i, j, k + 1), of_cosine);
    let along_both = |i| mix(along_cosine(i, j), along_cosine(i, j + 1), of_roughness);
    mix(along_both(i), along_both(i + 1), of_ior)
}

/// An entry, by its indices.
fn entry(is_inside: bool, [i, j, k]: [usize; 3]) -> [f32; 2] {
    let part = |index: usize, n: usize| index as f32 / (n - 1) as f32;
    let square = part(i, N_IORS).powi(2);
    let ior = ((1.0 + square) / (1.0 - square)).clamp(MIN_IOR, MAX_IOR);
    let roughness = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * part(j, N_ROUGHNESSES);
    let cosine = part(k, N_COSINES).powi(2).max(MIN_COSINE);
    let facets = Ggx::of_roughness(roughness).expect("as rough as the roughest mirror");
    integrated(facets, cosine, if is_inside { 1.0 / ior } else { ior })
}

/// The mean over visible facets.
fn integrated(facets: Ggx, cosine: f32, eta: f32) -> [f32; 2] {
    const N: u16 = 256;
    const GOLDEN: f32 = 0.618_034;
    let outgoing = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    let mut sums = [0.0; 2];
    for i in 0..N {
        let square = [((0.5 + f32::from(i)) * GOLDEN).fract(), (0.5 + f32::from(i)) / f32::from(N)];
        let normal = facets.sample(outgoing, square);
        let cosine = outgoing.dot(normal).clamp(0.0, 1.0);
        let reflected = facets.passed(outgoing, reflect(outgoing, normal));
        let Some((inner, reflectance)) = refracted_cosine(cosine, eta).zip(fresnel(cosine, eta)) else {
            // Total reflection, whatever the strength of the other one.
            sums[0] += reflected;
            continue;
        };
        let incident = unit(-(outgoing - cosine * normal) / eta - inner * normal);
        let through = facets.passed(outgoing, -incident);
        sums[0] += through;
        sums[1] += reflectance * (reflected - through);
    }
    sums.map(|sum| sum / f32::from(N))
}
