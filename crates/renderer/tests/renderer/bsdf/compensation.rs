//! Compensation of what microfacets lose: white furnaces, and pictures by the path integrator.

use canted_film::Pixel;
use canted_renderer::{Bsdf, Evaluation, Integrator, Settings};
use canted_scene::Material;

use super::{flux_factor, materials, numbers, outgoing};
use crate::common::{camera, film, scene, settings, sphere};

const ROUGHNESS: [f32; 7] = [0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0];
const COSINES: [f64; 7] = [1.0, 0.8, 0.5, 0.3, 0.15, 0.05, 0.01];

/// Flux of a material by sampling, and its standard error.
fn furnace(bsdf: &Bsdf, cosine: f64) -> (f64, f64) {
    const N: u32 = 4000;
    let (mut sum, mut squares) = (0.0, 0.0);
    for (square, choice) in numbers(N) {
        let Some(scattered) = bsdf.sample(outgoing(cosine), square, choice) else { continue };
        let weight = f64::from(scattered.weight[0]) * flux_factor(bsdf, scattered.is_transmitted);
        sum += weight;
        squares += weight * weight;
    }
    let mean = sum / f64::from(N);
    (mean, ((squares / f64::from(N) - mean * mean).max(0.0) / f64::from(N)).sqrt())
}

/// White materials of kinds that are compensated completely.
fn white(roughness: f32) -> [(&'static str, Bsdf); 6] {
    let plastic = Bsdf { roughness, specular: 1.0, is_compensated: true, ..Bsdf::lambert([1.0; 3]) };
    let thin = Bsdf { transmission: 1.0, thin_walled: true, ..plastic };
    [
        ("metal", Bsdf { metallic: 1.0, ..plastic }),
        ("plastic", plastic),
        ("faint plastic", Bsdf { specular: 0.4, ..plastic }),
        ("half a metal", Bsdf { metallic: 0.5, ..plastic }),
        ("thin wall", thin),
        ("thin milk glass", Bsdf { transmission: 0.5, ..thin }),
    ]
}

/// A white furnace shows at least 0.98 and hardly more than 1 of every compensated material.
#[test]
fn white_furnaces_stay_white() {
    for roughness in ROUGHNESS {
        for (name, bsdf) in white(roughness) {
            for cosine in COSINES {
                let (mean, error) = furnace(&bsdf, cosine);
                // The fits: 0.6 % for metals, and 1.2 % for the sum of coat and base.
                let allowed = 0.98 - 4.0 * error..=1.015 + 4.0 * error;
                assert!(allowed.contains(&mean), "{name}, roughness {roughness}, cosine {cosine}: {mean} ± {error}");
            }
        }
    }
}

/// Single scattering loses what the test above requires.
#[test]
fn single_scattering_fails_the_furnace() {
    for (name, bsdf, cosine, most) in [("metal", white(1.0)[0].1, 1.0, 0.5), ("plastic", white(0.75)[1].1, 0.05, 0.9)] {
        let (mean, error) = furnace(&Bsdf { is_compensated: false, ..bsdf }, cosine);
        assert!(mean + 4.0 * error < most, "{name}: {mean}");
    }
}

/// PDFs are those of the sampled directions, and weights are values over PDFs.
#[test]
fn weights_are_values_over_pdfs() {
    for roughness in [0.1, 0.5, 1.0] {
        for (name, bsdf) in materials(roughness) {
            let bsdf = Bsdf { is_compensated: true, ..bsdf };
            for (square, choice) in numbers(300) {
                let Some(found) = bsdf.sample(outgoing(0.4), square, choice).filter(|s| !s.is_delta) else { continue };
                let Evaluation { value, density } = bsdf.evaluate(outgoing(0.4), found.incident);
                assert_eq!(found.density, density, "{name}");
                for (weight, value) in found.weight.into_iter().zip(value) {
                    assert!((weight - value / density).abs() <= f32::EPSILON * weight, "{name}");
                }
            }
        }
    }
}

/// Mirrors, and glass that refracts, are as before.
#[test]
fn other_boundaries_are_unchanged() {
    let mirror = Bsdf { metallic: 1.0, roughness: 0.0, ..Bsdf::lambert([0.9, 0.5, 0.1]) };
    let glass = Bsdf { transmission: 1.0, specular: 1.0, roughness: 0.5, ..Bsdf::lambert([1.0; 3]) };
    for bsdf in [mirror, glass, Bsdf { is_inside: true, ..glass }] {
        let compensated = Bsdf { is_compensated: true, ..bsdf };
        for (square, choice) in numbers(300) {
            let of = |bsdf: &Bsdf| bsdf.sample(outgoing(0.4), square, choice);
            assert_eq!(of(&bsdf), of(&compensated));
        }
    }
}

/// Mean of a picture that is filled by a white sphere of rough metal in a white furnace.
fn picture(energy_compensation: bool) -> f64 {
    let metal = Material { base_color: [1.0; 3], metallic: 1.0, roughness: 0.8, ..Material::default() };
    let mut furnace = scene(vec![sphere([0.0; 3], 1.0, 3, 0)], vec![metal]);
    furnace.environment = Some([1.0; 3].into());
    let settings = Settings { integrator: Integrator::Path, energy_compensation, ..settings(12, 12, 64, 8) };
    let film = film(&furnace, &camera([2.0, 3.0, 4.0], [0.0; 3], 15.0), &settings);
    film.pixels().iter().map(|pixel: &Pixel| pixel.mean()[0]).sum::<f64>() / 144.0
}

#[test]
fn setting_reaches_the_path_integrator() {
    let [on, off] = [true, false].map(picture);
    assert!((0.98..=1.02).contains(&on) && off < 0.8, "{on} {off}");
}
