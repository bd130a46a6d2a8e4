//! White furnace test: no material reflects more than the incident light. Quadrature and sampling agree.

use canted_renderer::Bsdf;

use super::{Steps, flux, flux_factor, materials, numbers, outgoing};
use crate::common::Vector;

/// Mean and variance of the sampled flux by color, without delta lobes.
fn sampled(bsdf: &Bsdf, outgoing: [f32; 3], n: u32) -> (Vector, Vector) {
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for (square, choice) in numbers(n) {
        let Some(scattered) = bsdf.sample(outgoing, square, choice).filter(|s| !s.is_delta) else { continue };
        let factor = flux_factor(bsdf, scattered.is_transmitted);
        for k in 0..3 {
            let fraction = f64::from(scattered.weight[k]) * factor;
            sum[k] += fraction;
            squares[k] += fraction * fraction;
        }
    }
    let mean = sum.map(|x| x / f64::from(n));
    (mean, std::array::from_fn(|k| (squares[k] / f64::from(n) - mean[k] * mean[k]).max(0.0)))
}

/// The flux by quadrature, and the largest difference of three coarser rules as an estimate above its error.
fn quadrature(bsdf: &Bsdf, outgoing: [f32; 3], [along, about]: Steps) -> (Vector, f64) {
    let fine = flux(bsdf, outgoing, [along, about]);
    let off = |coarser: u32| {
        let coarse = flux(bsdf, outgoing, [along * coarser / 8, about * coarser / 8]);
        (0..3).map(|k| (fine[k] - coarse[k]).abs()).fold(0.0, f64::max)
    };
    (fine, [4, 5, 6].into_iter().map(off).fold(0.0, f64::max))
}

#[test]
fn quadrature_and_sampling_agree() {
    const N: u32 = 20_000;
    for roughness in [0.01, 0.2, 0.6, 1.0] {
        for (name, bsdf) in materials(roughness) {
            for cosine in [1.0, 0.7, 0.3] {
                let outgoing = outgoing(cosine);
                let (want, error) = quadrature(&bsdf, outgoing, [120, 80]);
                let (mean, variance) = sampled(&bsdf, outgoing, N);
                for k in 0..3 {
                    // Single precision adds a few ulps.
                    let allowed = error + 5.0 * (variance[k] / f64::from(N)).sqrt() + 16.0 * f64::from(f32::EPSILON);
                    let off = (mean[k] - want[k]).abs();
                    assert!(off <= allowed, "{name}, {roughness}, {cosine}: {} for {}", mean[k], want[k]);
                }
            }
        }
    }
}

const ROUGHNESS: [f32; 8] = [0.0, 0.04, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0];
const IORS: [f32; 8] = [1.0, 1.0001, 1.01, 1.1, 1.5, 2.4, 5.0, 30.0];
const COSINES: [f64; 10] = [1.0, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1, 0.05, 0.01];

/// Without a diffuse base no sample has a weight above 1, at any roughness.
#[test]
fn facets_conserve_energy() {
    let clear = Bsdf { transmission: 1.0, specular: 1.0, ..Bsdf::lambert([1.0; 3]) };
    let kinds = [clear, Bsdf { specular: 0.4, ..clear }, Bsdf { metallic: 1.0, ..clear }];
    let kinds = kinds.into_iter().flat_map(|b| [b, Bsdf { is_inside: true, ..b }, Bsdf { thin_walled: true, ..b }]);
    for kind in kinds {
        for (roughness, ior) in ROUGHNESS.into_iter().flat_map(|roughness| IORS.map(|ior| (roughness, ior))) {
            let bsdf = Bsdf { roughness, ior, ..kind };
            for (cosine, (square, choice)) in COSINES.into_iter().cycle().zip(numbers(1000)) {
                let Some(scattered) = bsdf.sample(outgoing(cosine), square, choice) else { continue };
                let fraction = f64::from(scattered.weight[0]) * flux_factor(&bsdf, scattered.is_transmitted);
                // Masking and PDF fraction everything except sums of two roots, colors and probabilities except one
                // sum.
                assert!(fraction <= 1.0 + 16.0 * f64::from(f32::EPSILON), "{bsdf:?} {cosine}: {fraction}");
            }
        }
    }
}

/// Flux of the coat over a black base: the mean weight over a grid of random numbers, and the difference of a coarser
/// grid.
fn coat(black: &Bsdf, outgoing: [f32; 3]) -> (f64, f64) {
    let mean = |steps: u16| {
        let at = |i: u16| (f32::from(i) + 0.5) / f32::from(steps);
        let grid = (0..steps).flat_map(|i| (0..steps).map(move |j| [at(i), at(j)]));
        let weight = |square| black.sample(outgoing, square, 0.5).map_or(0.0, |s| f64::from(s.weight[0]));
        grid.map(weight).sum::<f64>() / f64::from(steps).powi(2)
    };
    let fine = mean(64);
    (fine, (fine - mean(40)).abs())
}

/// Flux of the white base alone, which depends only on the polar cosine.
fn base(white: &Bsdf, outgoing: [f32; 3]) -> f64 {
    const STEPS: u32 = 500;
    let black = Bsdf { base_color: [0.0; 3], ..*white };
    let at = |i: u32| {
        let incident = super::outgoing((f64::from(i) + 0.5) / f64::from(STEPS));
        // Outside of the lobe, so that the subtraction keeps its digits.
        let value = |bsdf: &Bsdf| f64::from(bsdf.evaluate(outgoing, incident).value[0]);
        value(white) - value(&black)
    };
    (0..STEPS).map(at).sum::<f64>() * std::f64::consts::TAU / f64::from(STEPS)
}

/// A white base under a coat reflects at most 1, and loses little more than the microfacets do.
#[test]
fn base_and_coat_conserve_energy() {
    for roughness in ROUGHNESS {
        for ior in IORS {
            for specular in [1.0, 0.4] {
                let white = Bsdf { roughness, ior, specular, ..Bsdf::lambert([1.0; 3]) };
                for cosine in COSINES {
                    let (layer, error) = coat(&Bsdf { base_color: [0.0; 3], ..white }, outgoing(cosine));
                    let total = layer + base(&white, outgoing(cosine));
                    let allowed = 1.0 + error + 32.0 * f64::from(f32::EPSILON);
                    assert!(total <= allowed, "{white:?} {cosine}: {total} of {allowed}");
                    // The bound of the mean costs 0.012 of the light that passes twice; a smooth coat loses nothing.
                    let least = if roughness == 0.0 && ior <= 4.0 { 0.985 } else { 0.0 };
                    assert!(total >= least, "{white:?} {cosine}: {total}");
                }
            }
        }
    }
}

/// Mixtures are sums of their parts, so energy conservation extends to them.
#[test]
fn mixtures_are_linear() {
    let (metallic, transmission) = (0.25, 0.75);
    for (thin_walled, is_inside) in [(false, false), (true, false), (true, true)] {
        let plastic = Bsdf { specular: 0.8, roughness: 0.6, thin_walled, is_inside, ..Bsdf::lambert([0.9, 0.5, 0.1]) };
        let glass = Bsdf { transmission: 1.0, ..plastic };
        let metal = Bsdf { metallic: 1.0, ..plastic };
        let mixture = Bsdf { metallic, transmission, ..plastic };
        for (square, choice) in numbers(1000) {
            let o = outgoing(f64::from(0.1 + 0.9 * choice));
            let [x, y, z] = canted_renderer::sampling::cosine_hemisphere(square);
            for i in [[x, y, z], [x, y, -z]] {
                let [metal, plastic, glass, got] = [metal, plastic, glass, mixture].map(|b| b.evaluate(o, i).value);
                for k in 0..3 {
                    let other = (1.0 - transmission) * plastic[k] + transmission * glass[k];
                    let want = metallic * metal[k] + (1.0 - metallic) * other;
                    // A dozen roundings in sums of positive terms.
                    assert!((got[k] - want).abs() <= 12.0 * f32::EPSILON * want, "{got:?} {want}");
                }
            }
        }
    }
}
