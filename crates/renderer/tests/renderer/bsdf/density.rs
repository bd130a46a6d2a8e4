//! Samples are where the density says.

use std::f64::consts::{PI, TAU};

use canted_renderer::{Bsdf, Evaluation};

use super::{materials, numbers, outgoing};
use crate::chi_square::deviation;
use crate::common::narrow;

const RINGS: usize = 16;
const SECTORS: usize = 16;
const N: u32 = 100_000;

/// Counts of samples in cells of equal angles, then of all others: lost ones and those of mirrors.
fn counts(bsdf: &Bsdf, outgoing: [f32; 3]) -> Vec<f64> {
    let mut counts = vec![0.0; RINGS * SECTORS + 1];
    for (square, choice) in numbers(N) {
        let scattered = bsdf.sample(outgoing, square, choice).filter(|scattered| !scattered.is_delta);
        let cell = scattered.map_or(RINGS * SECTORS, |scattered| {
            let [x, y, z] = scattered.incident.map(f64::from);
            let (fall, turn) = (z.clamp(-1.0, 1.0).acos() / PI, y.atan2(x) / TAU + 0.5);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "both are in 0..=1")]
            let (ring, sector) = ((fall * RINGS as f64) as usize, (turn * SECTORS as f64) as usize);
            ring.min(RINGS - 1) * SECTORS + sector.min(SECTORS - 1)
        });
        counts[cell] += 1.0;
    }
    counts
}

/// Integrals of a density over the same cells, then what is left to 1.
///
/// Points stand in a lattice askew to the rings, for a lobe's edge may run along one.
fn expected(density: impl Fn([f32; 3]) -> f32) -> Vec<f64> {
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

/// Six standard deviations leave no room for chance.
const LIMIT: f64 = 6.0;

#[test]
fn samples_follow_the_density() {
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

/// The density of a slightly rougher surface, or of one that chooses its lobes otherwise, is refused.
#[test]
fn the_check_sees_wrong_densities() {
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
fn a_sample_carries_value_over_density() {
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
                // Product and quotient of a Lambert surface may round; the others are this quotient.
                for (weight, value) in scattered.weight.into_iter().zip(value) {
                    assert!((weight - value / density).abs() <= f32::EPSILON * weight, "{name}");
                }
            }
        }
    }
}

/// What the diffuse integrators always did: cosine-sampled directions of weight `base_color`, to the bit.
#[test]
fn lambert_is_the_cheap_path() {
    let bsdf = Bsdf::lambert([0.8, 0.3, 0.1]);
    for (square, choice) in numbers(1000) {
        let scattered = bsdf.sample(outgoing(0.3), square, choice).unwrap();
        assert_eq!(scattered.weight, bsdf.base_color);
        assert_eq!(scattered.incident, canted_renderer::sampling::cosine_hemisphere(square));
        assert!(!scattered.is_delta && !scattered.is_transmitted);
    }
    assert_eq!(bsdf.albedo(), bsdf.base_color);
}
