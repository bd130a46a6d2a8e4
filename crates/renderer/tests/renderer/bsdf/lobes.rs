//! Further lobes: white furnaces for each, PDFs, and what each must do.

use canted_renderer::{Bsdf, Integrator, Lobes, Settings};
use canted_scene::{Lobes as Factors, Material};

use super::density::{LIMIT, counts, expected};
use super::{numbers, outgoing};
use crate::chi_square::deviation;
use crate::common::{camera, film, scene, settings, sphere};

const COSINES: [f64; 6] = [1.0, 0.7, 0.4, 0.2, 0.08, 0.02];

/// One material for each lobe, white, over bases of the same roughness.
fn white(roughness: f32) -> Vec<(&'static str, Bsdf)> {
    let plastic = Bsdf { roughness, specular: 1.0, is_compensated: true, ..Bsdf::lambert([1.0; 3]) };
    let metal = Bsdf { metallic: 1.0, ..plastic };
    let with = |base: Bsdf, lobes: Lobes| Bsdf { lobes: Some(lobes), ..base };
    let coat = Lobes { clearcoat: 1.0, clearcoat_roughness: 0.3, ..Lobes::default() };
    let smooth = Lobes { clearcoat: 0.7, ..Lobes::default() };
    let sheen = Lobes { sheen_color: [1.0; 3], sheen_roughness: roughness, ..Lobes::default() };
    let stretched = Lobes { anisotropy: 0.6, direction: [0.6, 0.8], ..Lobes::default() };
    let film = Lobes { iridescence: 1.0, iridescence_thickness: 380.0, ..Lobes::default() };
    let colored = Lobes { specular_color: [0.9; 3], ..Lobes::default() };
    vec![
        ("coated plastic", with(plastic, coat)),
        ("coated metal", with(metal, coat)),
        ("smooth coat", with(metal, smooth)),
        ("velvet", with(Bsdf { specular: 0.0, ..plastic }, sheen)),
        ("sheen over plastic", with(plastic, sheen)),
        ("brushed metal", with(metal, stretched)),
        ("brushed plastic", with(plastic, stretched)),
        ("iridescent metal", with(metal, film)),
        ("iridescent plastic", with(plastic, film)),
        ("tinted plastic", with(plastic, colored)),
        // As specular and glossiness are read.
        ("specular color", with(Bsdf { ior: 1000.0, ..plastic }, Lobes { specular_color: [0.5; 3], ..colored })),
        ("everything", with(plastic, Lobes { sheen_color: [0.5; 3], clearcoat: 0.8, ..stretched })),
    ]
}

/// Flux of a material in its brightest channel by sampling, and its standard error. A base gets what the brightest channel of a colored
/// reflection leaves, so that others lose.
fn furnace(bsdf: &Bsdf, cosine: f64) -> (f64, f64) {
    const N: u32 = 4000;
    let (mut sums, mut squares) = ([0.0; 3], [0.0; 3]);
    for (square, choice) in numbers(N) {
        let Some(scattered) = bsdf.sample(outgoing(cosine), square, choice) else { continue };
        for (k, weight) in scattered.weight.map(f64::from).into_iter().enumerate() {
            sums[k] += weight;
            squares[k] += weight * weight;
        }
    }
    let of = |k: usize| {
        let mean = sums[k] / f64::from(N);
        (mean, ((squares[k] / f64::from(N) - mean * mean).max(0.0) / f64::from(N)).sqrt())
    };
    (0..3).map(of).fold((0.0, 0.0), |best, next| if next.0 > best.0 { next } else { best })
}

#[test]
fn white_furnaces_stay_white() {
    let mut wrong = Vec::new();
    for roughness in [0.1, 0.2, 0.35, 0.5, 0.75, 1.0] {
        for (name, bsdf) in white(roughness) {
            for cosine in COSINES {
                let (mean, error) = furnace(&bsdf, cosine);
                // The mean over facets of a film's reflectance, which is no monotonic function of the angle, has no fit.
                let least = if name == "iridescent plastic" && cosine < 0.1 { 0.94 } else { 0.98 };
                let allowed = least - 4.0 * error..=1.02 + 4.0 * error;
                if !allowed.contains(&mean) {
                    wrong.push(format!("{name}, roughness {roughness}, cosine {cosine}: {mean:.4} ± {error:.4}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Without compensation nothing is gained.
#[test]
fn single_scattering_gains_nothing() {
    for (name, bsdf) in white(0.5) {
        for cosine in COSINES {
            let (mean, error) = furnace(&Bsdf { is_compensated: false, ..bsdf }, cosine);
            assert!((0.3..=1.02 + 4.0 * error).contains(&mean), "{name}, cosine {cosine}: {mean} ± {error}");
        }
    }
}

/// The furnace sees a sheen whose base is not dimmed.
#[test]
fn the_furnace_detects_missing_scaling() {
    let base = Bsdf { is_compensated: true, ..Bsdf::lambert([1.0; 3]) };
    let lobes = Lobes { sheen_color: [1.0; 3], sheen_roughness: 0.5, ..Lobes::default() };
    let (_, below) = (furnace(&base, 0.2), furnace(&Bsdf { base_color: [0.0; 3], lobes: Some(lobes), ..base }, 0.2).0);
    assert!(1.0 + below > 1.1, "{below}");
}

#[test]
fn samples_match_pdf() {
    for (name, bsdf) in white(0.5) {
        for cosine in [0.9, 0.3] {
            let outgoing = outgoing(cosine);
            let probabilities = expected(|incident| bsdf.evaluate(outgoing, incident).density);
            let deviation = deviation(&counts(&bsdf, outgoing), &probabilities);
            assert!(deviation < LIMIT, "{name} {cosine}: {deviation}");
        }
    }
}

/// Highlights are longer along the direction.
#[test]
fn anisotropy_stretches_along_its_direction() {
    let metal = Bsdf { metallic: 1.0, roughness: 0.3, ..Bsdf::lambert([1.0; 3]) };
    let brushed = |direction| {
        let lobes = Lobes { anisotropy: 0.8, direction, ..Lobes::default() };
        Bsdf { lobes: Some(lobes), ..metal }
    };
    let value = |bsdf: &Bsdf, incident| bsdf.evaluate([0.0, 0.0, 1.0], incident).value[0];
    let (along, across) = ([0.6, 0.0, 0.8], [0.0, 0.6, 0.8]);
    let x = brushed([1.0, 0.0]);
    assert!(value(&x, along) > 3.0 * value(&x, across));
    let y = brushed([0.0, 1.0]);
    assert!((value(&y, across) - value(&x, along)).abs() < 1e-5);
    let none = Bsdf { lobes: Some(Lobes::default()), ..metal };
    assert_eq!(value(&none, along), value(&metal, along), "the isotropic distribution");
}

/// A film without thickness, or of the index of air, is not seen; one of 380 nm colors a metal.
#[test]
fn films_interfere() {
    let metal = Bsdf { metallic: 1.0, roughness: 0.0, ..Bsdf::lambert([0.6; 3]) };
    let weight = |film: Lobes| {
        let bsdf = Bsdf { lobes: Some(film), ..metal };
        bsdf.sample(outgoing(0.8), [0.5; 2], 0.5).unwrap().weight
    };
    let film = Lobes { iridescence: 1.0, iridescence_thickness: 380.0, ..Lobes::default() };
    let plain = metal.sample(outgoing(0.8), [0.5; 2], 0.5).unwrap().weight;
    for vanishing in [Lobes { iridescence_thickness: 0.0, ..film }, Lobes { iridescence_ior: 1.0, ..film }] {
        for (with, without) in weight(vanishing).into_iter().zip(plain) {
            // The product of both reflectances is at least 1e-5: an amplitude of 0.003, for two orders and two signs.
            assert!((with - without).abs() < 0.02, "{with} {without}");
        }
    }
    let [r, g, b] = weight(film);
    assert!((r - g).abs().max((g - b).abs()) > 0.05, "{r} {g} {b}");
}

/// A coat reflects, and a base below a black coat does not get brighter.
#[test]
fn coats_reflect_in_the_mirrored_direction() {
    let base = Bsdf { roughness: 0.9, ..Bsdf::lambert([0.2; 3]) };
    let lobes = Lobes { clearcoat: 1.0, clearcoat_roughness: 0.1, ..Lobes::default() };
    let coated = Bsdf { lobes: Some(lobes), ..base };
    let [x, y, z] = outgoing(0.5);
    let mirrored = [-x, -y, z];
    assert!(coated.evaluate([x, y, z], mirrored).value[0] > 3.0 * base.evaluate([x, y, z], mirrored).value[0]);
    let smooth = Bsdf { lobes: Some(Lobes { clearcoat_roughness: 0.0, ..lobes }), ..base };
    let n_delta = numbers(1000).filter(|&(s, c)| smooth.sample([x, y, z], s, c).is_some_and(|found| found.is_delta));
    assert!(n_delta.count() > 50);
}

/// Light that crosses an absorbing ball straight through its center is left as Beer's law says.
#[test]
fn solids_absorb() {
    let lobes = Some(Box::new(Factors { absorption: [0.0, 0.5, 2.0], ..Factors::default() }));
    let glass =
        Material { base_color: [1.0; 3], roughness: 0.0, transmission: 1.0, ior: 1.0, lobes, ..Material::default() };
    let mut ball = scene(vec![sphere([0.0; 3], 1.0, 5, 0)], vec![glass]);
    ball.environment = Some([1.0; 3].into());
    let settings = Settings { integrator: Integrator::Path, ..settings(1, 1, 16, 8) };
    let film = film(&ball, &camera([0.0, 0.0, 6.0], [0.0; 3], 0.1), &settings);
    for (got, absorption) in film.pixels()[0].mean().into_iter().zip([0.0_f64, 0.5, 2.0]) {
        let want = (-2.0 * absorption).exp();
        // The ball has flat faces: a little less than its diameter.
        assert!((got - want).abs() < 0.01, "{got} {want}");
    }
}
