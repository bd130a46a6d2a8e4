//! BSDF samples follow their PDF.

use std::f64::consts::{PI, TAU};

use canted_renderer::{Bsdf, Evaluation};

use super::{materials, numbers, outgoing};
use crate::chi_square::deviation;
use crate::common::narrow;

const RINGS: usize = 16;
const SECTORS: usize = 16;
const N: u32 = 100_000;

/// Sample counts in cells of equal angles; the last counts lost samples and delta lobes.
pub(super) fn counts(bsdf: &Bsdf, outgoing: [f32; 3]) -> Vec<f64> {
    let mut counts = vec![0.0; RINGS * SECTORS + 1];
    for (square, choice) in numbers(N) {
        let scattered = bsdf.sample(outgoing, square, choice).filter(|scattered| !scattered.is_delta);
        let cell = scattered.map_or(RINGS * SECTORS, |scattered| {
            let [x, y, z] = scattered.incident.map(f64::from);
            let (fall, turn) = (z.clamp(-1.0, 1.0).acos() / PI, y.atan2(x) / TAU + 0.5);
            let (ring, sector) = ((fall * RINGS as f64) as usize, (turn * SECTORS as f64) as usize);
            ring.min(RINGS - 1) * SECTORS + sector.min(SECTORS - 1)
        });
        counts[cell] += 1.0;
    }
    counts
}

/// Integrals of a PDF over the same cells; the last is the remainder to 1.
///
/// The points form a lattice that is skewed to the rings, because the edge of a lobe may be parallel to a ring.
pub(super) fn expected(density: impl Fn([f32; 3]) -> f32) -> Vec<f64> {
    const FINE: usize = 16;
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let mut cells = vec![0.0; RINGS * SECTORS + 1];
    for i in 0..RINGS * FINE {
        for j in 0..SECTORS * FINE {
            let (sine, z) = ((i as f64 + (j as f64 * GOLDEN).fract()) / (RINGS * FINE) as f64 * PI).sin_cos();
            let (s, c) = (((j as f64 + 0.5) / (SECTORS * FINE) as f64 - 0.5) * TAU).sin_cos();
            let area = sine * PI * TAU / ((RINGS * SECTORS * FINE * FINE) as f64);
            cells[i / FINE * SECTORS + j / FINE] += f64::from(density(narrow([sine * c, sine * s, z]))) * area;
        }
    }
    cells[RINGS * SECTORS] = 1.0 - cells.iter().sum::<f64>();
    cells
}

/// Six standard deviations: false alarms are practically impossible.
pub(super) const LIMIT: f64 = 6.0;

#[test]
fn samples_match_pdf() {
    for roughness in [0.45, 1.0] {
        for (name, bsdf) in materials(roughness) {
            for cosine in [0.98, 0.6, 0.15] {
                let outgoing = outgoing(cosine);
                let probabilities = expected(|incident| bsdf.evaluate(outgoing, incident).density);
                let deviation = deviation(&counts(&bsdf, outgoing), &probabilities);
                assert!(deviation < LIMIT, "{name}, roughness {roughness}, cosine {cosine}: {deviation}");
            }
        }
    }
}

/// The test above detects a slightly rougher surface, and a wrong choice of lobes.
#[test]
fn test_detects_wrong_pdfs() {
    let plastic = Bsdf { specular: 1.0, roughness: 0.5, ..Bsdf::lambert([0.5; 3]) };
    let metal = Bsdf { metallic: 1.0, ..plastic };
    let cases = [(metal, Bsdf { roughness: 0.52, ..metal }), (plastic, Bsdf { base_color: [0.2; 3], ..plastic })];
    for (right, wrong) in cases {
        let outgoing = outgoing(0.6);
        let probabilities = expected(|incident| wrong.evaluate(outgoing, incident).density);
        assert!(deviation(&counts(&right, outgoing), &probabilities) > LIMIT, "{wrong:?}");
    }
}

#[test]
fn sample_weight_is_value_over_pdf() {
    for roughness in [0.1, 0.5, 1.0] {
        for (name, bsdf) in materials(roughness) {
            for (square, choice) in numbers(1000) {
                let Some(scattered) = bsdf.sample(outgoing(0.4), square, choice) else { continue };
                let Evaluation { value, density } = bsdf.evaluate(outgoing(0.4), scattered.incident);
                if scattered.is_delta {
                    assert_eq!(scattered.density, 0.0, "{name}");
                    continue;
                }
                assert_eq!(scattered.density, density, "{name}");
                // Lambertian samples may round product and quotient; others are this quotient.
                for (weight, value) in scattered.weight.into_iter().zip(value) {
                    assert!((weight - value / density).abs() <= f32::EPSILON * weight, "{name}");
                }
            }
        }
    }
}

/// Lambertian surfaces are cosine-sampled with weight `base_color`, bit for bit.
#[test]
fn lambert_is_cosine_sampled() {
    let bsdf = Bsdf::lambert([0.8, 0.3, 0.1]);
    for (square, choice) in numbers(1000) {
        let scattered = bsdf.sample(outgoing(0.3), square, choice).unwrap();
        assert_eq!(scattered.weight, bsdf.base_color);
        assert_eq!(scattered.incident, canted_renderer::sampling::cosine_hemisphere(square));
        assert!(!scattered.is_delta && !scattered.is_transmitted);
    }
    assert_eq!(bsdf.albedo(), bsdf.base_color);
}
