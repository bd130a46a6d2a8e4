//! Tests of the BSDF against quadrature in `f64`, textbook formulas and sample counts.
//!
//! All but `compensation` are about single scattering between microfacets.

use std::f64::consts::{PI, TAU};

use canted_renderer::sampling::Basis;
use canted_renderer::{Bsdf, BsdfSample, Evaluation, Hemisphere, Integrator, Lobes, Pattern, Sampler, Settings};
use canted_scene::{Lobes as Factors, Material};

use crate::common::{Vector, camera, deviation, dot, film, narrow, scene, settings, sphere, under, unit};

/// One material of each kind, then mixtures.
pub(crate) fn materials(roughness: f32) -> Vec<(&'static str, Bsdf)> {
    let white = Bsdf { roughness, ..Bsdf::lambert([1.0; 3]) };
    let colored = Bsdf { base_color: [0.9, 0.5, 0.1], ..white };
    let glass = Bsdf { transmission: 1.0, specular: 1.0, ..white };
    let thin = Bsdf { thin_walled: true, ..glass };
    vec![
        ("lambert", white),
        ("metal", Bsdf { metallic: 1.0, ..white }),
        ("tinted metal", Bsdf { metallic: 1.0, ..colored }),
        ("plastic", Bsdf { specular: 1.0, ..white }),
        ("faint plastic", Bsdf { specular: 0.3, ..colored }),
        ("glass", glass),
        ("glass from inside", Bsdf { is_inside: true, ..glass }),
        ("faint tinted glass", Bsdf { specular: 0.5, ..Bsdf { transmission: 1.0, ..colored } }),
        ("thin glass", thin),
        ("milk glass", Bsdf { transmission: 0.5, ..glass }),
        ("milk glass from inside", Bsdf { transmission: 0.5, is_inside: true, ..glass }),
        ("everything", Bsdf { metallic: 0.3, transmission: 0.6, specular: 0.7, ..colored }),
        ("everything thin", Bsdf { metallic: 0.3, transmission: 0.6, thin_walled: true, ..colored }),
    ]
}

/// A direction with this cosine to +z, off the axes.
pub(crate) fn outgoing(cosine: f64) -> [f32; 3] {
    let sine = (1.0 - cosine * cosine).sqrt();
    narrow([0.6 * sine, -0.8 * sine, cosine])
}

/// Independent points of the unit square and choices.
pub(crate) fn numbers(n: u32) -> impl Iterator<Item = ([f32; 2], f32)> {
    let sampler = Sampler::new(Pattern::Random, n, 11);
    (0..n).map(move |i| (sampler.pair(i, 0, 0), sampler.pair(i, 0, 1)[0]))
}

/// Undoes the scaling of radiance by refraction, so that flux remains.
pub(crate) fn flux_factor(bsdf: &Bsdf, is_transmitted: bool) -> f64 {
    let ior = f64::from(bsdf.ior);
    match (is_transmitted && !bsdf.thin_walled, bsdf.is_inside) {
        (false, _) => 1.0,
        (true, false) => ior * ior,
        (true, true) => 1.0 / (ior * ior),
    }
}

/// Steps of a quadrature along the angle from an axis and around it.
pub(crate) type Steps = [u32; 2];

/// Midpoint rule over the sphere in the cube root of the angle to `axis`, which resolves narrow lobes around it.
fn integrate<const N: usize>(axis: [f32; 3], [along, about]: Steps, f: impl Fn([f32; 3]) -> [f64; N]) -> [f64; N] {
    let basis = Basis::about(axis);
    let mut sum = [0.0; N];
    for i in 0..along {
        let root = (f64::from(i) + 0.5) / f64::from(along);
        let angle = std::f64::consts::PI * root.powi(3);
        let area = 3.0 * std::f64::consts::PI * root.powi(2) * angle.sin() * std::f64::consts::TAU
            / (f64::from(along) * f64::from(about));
        for j in 0..about {
            let (s, c) = (std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(about)).sin_cos();
            let direction = basis.direction(narrow([angle.sin() * c, angle.sin() * s, angle.cos()]));
            let value = f(direction);
            for k in 0..N {
                sum[k] += value[k] * area;
            }
        }
    }
    sum
}

/// Reflected flux by color, and transmitted flux, without delta lobes.
pub(crate) fn flux(bsdf: &Bsdf, outgoing: [f32; 3], steps: Steps) -> Vector {
    let [x, y, z] = outgoing;
    // Lobes are around the mirrored and the refracted direction.
    let eta = if bsdf.thin_walled {
        1.0
    } else if bsdf.is_inside {
        1.0 / bsdf.ior
    } else {
        bsdf.ior
    };
    let refracted = (1.0 - (1.0 - z * z) / (eta * eta)).max(0.0).sqrt();
    let bent = crate::common::unit([-x / eta, -y / eta, -refracted].map(f64::from));
    let side = |axis, is_transmitted: bool| {
        let factor = flux_factor(bsdf, is_transmitted);
        integrate(axis, steps, |incident| {
            let counts = (incident[2] < 0.0) == is_transmitted;
            let value = if counts { bsdf.evaluate(outgoing, incident).value } else { [0.0; 3] };
            value.map(|x| f64::from(x) * factor)
        })
    };
    let (reflected, transmitted) = (side([-x, -y, z], false), side(narrow(bent), true));
    std::array::from_fn(|k| reflected[k] + transmitted[k])
}

// BSDF samples follow their PDF.

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
        let all = materials(roughness).into_iter();
        let uniform = |bsdf| Bsdf { hemisphere: Hemisphere::Uniform, ..bsdf };
        let kinds = |bsdf| [bsdf, Bsdf { is_compensated: true, ..bsdf }, uniform(bsdf)];
        for (name, bsdf) in all.flat_map(|(name, bsdf)| kinds(bsdf).map(|bsdf| (name, bsdf))) {
            for (square, choice) in numbers(1000) {
                let Some(scattered) = bsdf.sample(outgoing(0.4), square, choice) else { continue };
                let Evaluation { value, density } = bsdf.evaluate(outgoing(0.4), scattered.incident);
                if scattered.is_delta {
                    assert_eq!(scattered.density, 0.0, "{name}");
                    continue;
                }
                assert_eq!(scattered.density, density, "{name}");
                // Lambertian samples may round products and quotients; others are this quotient.
                for (weight, value) in scattered.weight.into_iter().zip(value) {
                    assert!((weight - value / density).abs() <= 2.0 * f32::EPSILON * weight, "{name}");
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

// Further lobes: white furnaces for each, PDFs, and what each must do.

const LOBE_COSINES: [f64; 6] = [1.0, 0.7, 0.4, 0.2, 0.08, 0.02];

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
pub(crate) fn furnace(bsdf: &Bsdf, cosine: f64) -> (f64, f64) {
    const N: u32 = 4000;
    let (mut sums, mut squares) = ([0.0; 3], [0.0; 3]);
    for (square, choice) in numbers(N) {
        let Some(scattered) = bsdf.sample(outgoing(cosine), square, choice) else { continue };
        let factor = flux_factor(bsdf, scattered.is_transmitted);
        for (k, weight) in scattered.weight.into_iter().enumerate() {
            let weight = f64::from(weight) * factor;
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
            for cosine in LOBE_COSINES {
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
        for cosine in LOBE_COSINES {
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
fn samples_of_lobes_match_pdf() {
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
    // Roughness 0 is smooth across the direction alone: by `KHR_materials_anisotropy` the roughness along it is the square of the strength.
    let smooth = Bsdf { roughness: 0.0, ..x };
    assert!(!smooth.is_delta_only() && value(&smooth, along) > 0.01 && value(&smooth, across) < 1e-3);
    assert!(Bsdf { roughness: 0.0, ..none }.is_delta_only());
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
    let ball = under([1.0; 3], scene(vec![sphere([0.0; 3], 1.0, 5, 0)], vec![glass]));
    let settings = Settings { integrator: Integrator::Path, ..settings(1, 1, 16, 8) };
    let film = film(&ball, &camera([0.0, 0.0, 6.0], [0.0; 3], 0.1), &settings);
    for (got, absorption) in film.pixels()[0].mean().into_iter().zip([0.0_f64, 0.5, 2.0]) {
        let want = (-2.0 * absorption).exp();
        // The ball has flat faces: a little less than its diameter.
        assert!((got - want).abs() < 0.01, "{got} {want}");
    }
}

// All inputs in range give finite results.

const LAST: f32 = 1.0 - f32::EPSILON / 2.0;
const SHARES: [f32; 6] = [0.0, 1e-30, 1e-4, 0.5, LAST, 1.0];
const ROUGHNESS: [f32; 8] = [0.0, 1e-4, 0.031_249, 0.031_25, 0.04, 0.3, LAST, 1.0];
const IORS: [f32; 9] = [1.0, 1.0 + f32::EPSILON, 1.0001, 1.0078, 1.0079, 1.5, 2.4, 100.0, 1000.0];
const COSINES: [f32; 9] = [1.0, LAST, 0.745_356, 0.5, 1e-3, 1e-7, 1e-20, f32::MIN_POSITIVE, 1e-45];

struct Dice {
    sampler: Sampler,
    n: u32,
}

impl Dice {
    fn number(&mut self) -> f32 {
        self.n += 1;
        self.sampler.pair(self.n, 0, 0)[0]
    }

    /// A number from a list, or sometimes `any` of a random number.
    fn pick(&mut self, list: &[f32], any: impl Fn(f32) -> f32) -> f32 {
        let (which, number) = (self.number(), self.number());
        let at = (which * (list.len() + 2) as f32) as usize;
        list.get(at).copied().unwrap_or_else(|| any(number))
    }

    fn share(&mut self) -> f32 {
        self.pick(&SHARES, |x| x)
    }

    fn bsdf(&mut self) -> Bsdf {
        Bsdf {
            base_color: std::array::from_fn(|_| self.share()),
            metallic: self.share(),
            roughness: self.pick(&ROUGHNESS, |x| x),
            specular: self.share(),
            transmission: self.share(),
            ior: self.pick(&IORS, |x| 1.0 + 3.0 * x),
            thin_walled: self.number() < 0.3,
            is_inside: self.number() < 0.5,
            is_compensated: self.number() < 0.5,
            hemisphere: Hemisphere::ALL[usize::from(self.number() < 0.5)],
            lobes: (self.number() < 0.5).then(|| self.lobes()),
            hair: None,
        }
    }

    fn lobes(&mut self) -> Lobes {
        let angle = 7.0 * self.number();
        Lobes {
            specular_color: std::array::from_fn(|_| 3.0 * self.share()),
            clearcoat: self.share(),
            clearcoat_roughness: self.pick(&ROUGHNESS, |x| x),
            sheen_color: std::array::from_fn(|_| self.share()),
            sheen_roughness: self.share(),
            anisotropy: self.share(),
            direction: [angle.cos(), angle.sin()],
            iridescence: self.share(),
            iridescence_ior: self.pick(&IORS, |x| 1.0 + 3.0 * x),
            iridescence_thickness: 1000.0 * self.share(),
            absorption: [0.0; 3],
        }
    }

    /// A unit vector above the horizon, possibly grazing.
    fn direction(&mut self) -> [f32; 3] {
        let cosine = self.pick(&COSINES, |x| x);
        let sine = ((1.0 - cosine) * (1.0 + cosine)).sqrt();
        let (s, c) = (std::f32::consts::TAU * self.pick(&[0.0, 0.25, 0.5], |x| x)).sin_cos();
        [sine * c, sine * s, cosine]
    }
}

fn is_valid(scattered: &BsdfSample) -> bool {
    let BsdfSample { incident, weight, density, is_delta, is_transmitted } = *scattered;
    let length = dot(incident.map(f64::from), incident.map(f64::from)).sqrt();
    weight.iter().all(|w| w.is_finite() && *w >= 0.0)
        && density.is_finite()
        && (density > 0.0) != is_delta
        && is_transmitted == (incident[2] < 0.0)
        && incident[2] != 0.0
        // Unit vectors combined by a facet normal: a dozen roundings.
        && (length - 1.0).abs() < 12.0 * f64::from(f32::EPSILON)
}

#[test]
fn results_are_always_finite() {
    let mut dice = Dice { sampler: Sampler::new(Pattern::Random, 1, 1), n: 0 };
    let (mut n_delta, mut n_through, mut n_lost) = (0, 0, 0);
    for _ in 0..300_000 {
        let (bsdf, outgoing) = (dice.bsdf(), dice.direction());
        let square = [dice.pick(&[0.0, LAST, 0.5], |x| x), dice.pick(&[0.0, LAST, 0.5], |x| x)];
        let choice = dice.pick(&[0.0, LAST], |x| x);
        match bsdf.sample(outgoing, square, choice) {
            Some(scattered) => {
                assert!(is_valid(&scattered), "{bsdf:?} {outgoing:?} {square:?} {choice}: {scattered:?}");
                n_delta += u32::from(scattered.is_delta);
                n_through += u32::from(scattered.is_transmitted);
            }
            None => n_lost += 1,
        }
        let [x, y, z] = dice.direction();
        // Lobes are highest in the mirrored direction.
        let [a, b, c] = outgoing;
        for incident in [[x, y, z], [x, y, -z], [-a, -b, c], [-a, -b, -c]] {
            let evaluation = bsdf.evaluate(outgoing, incident);
            let numbers = [evaluation.value[0], evaluation.value[1], evaluation.value[2], evaluation.density];
            let sound = numbers.iter().all(|x| x.is_finite() && *x >= 0.0);
            assert!(sound, "{bsdf:?} {outgoing:?} {incident:?}: {evaluation:?}");
        }
        assert!(bsdf.albedo().iter().all(|a| (0.0..=1.0).contains(a)), "{bsdf:?}: {:?}", bsdf.albedo());
    }
    assert!(n_delta > 30_000 && n_through > 10_000 && n_lost > 10_000, "{n_delta} {n_through} {n_lost}");
}

#[test]
fn directions_below_the_horizon_give_zero() {
    let bsdf = Bsdf { specular: 1.0, transmission: 0.5, ..Bsdf::lambert([0.5; 3]) };
    for outgoing in [[1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [1.0, 0.0, -0.0]] {
        assert_eq!(bsdf.sample(outgoing, [0.5; 2], 0.5), None);
        assert_eq!(bsdf.evaluate(outgoing, [0.0, 0.0, 1.0]).density, 0.0);
    }
    assert_eq!(bsdf.evaluate([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]).value, [0.0; 3]);
}

/// `is_delta_only` holds exactly for materials that evaluate to zero everywhere.
#[test]
fn delta_only_materials_evaluate_to_zero() {
    let mut dice = Dice { sampler: Sampler::new(Pattern::Random, 1, 2), n: 0 };
    let mirror = Bsdf { metallic: 1.0, roughness: 0.0, ..Bsdf::lambert([0.9; 3]) };
    let glass = Bsdf { transmission: 1.0, roughness: 0.0, specular: 1.0, ..Bsdf::lambert([1.0; 3]) };
    for bsdf in [mirror, glass, Bsdf { thin_walled: true, ..glass }] {
        assert!(bsdf.is_delta_only());
        for _ in 0..1000 {
            let evaluation = bsdf.evaluate(dice.direction(), dice.direction());
            assert_eq!((evaluation.value, evaluation.density), ([0.0; 3], 0.0));
        }
    }
    assert_eq!((mirror.albedo(), glass.albedo()), ([0.9; 3], [1.0; 3]));
    let up = narrow(unit([0.1, 0.2, 1.0]));
    for bsdf in
        [Bsdf { metallic: 0.9, ..mirror }, Bsdf { transmission: 0.9, ..glass }, Bsdf { roughness: 0.1, ..glass }]
    {
        assert!(!bsdf.is_delta_only() && bsdf.evaluate(up, [-up[0], -up[1], up[2]]).value[0] > 0.0);
    }
}
