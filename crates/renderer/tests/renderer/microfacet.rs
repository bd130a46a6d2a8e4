//! GGX compared with an implementation in `f64` from angles, after Walter et al. 2007 and Heitz 2014.

use canted_film::Pixel;
use canted_renderer::{Bsdf, BsdfSample, Integrator, Pattern, Sampler, Settings};
use canted_scene::Material;

use crate::bsdf::{Steps, flux, flux_factor, furnace, materials, numbers, outgoing};
use crate::common::{Vector, camera, dot, film, narrow, scene, settings, sphere, under, unit};

/// `D` of Walter et al., equation 33.
fn distribution(alpha: f64, normal: Vector) -> f64 {
    let angle = normal[2].min(1.0).acos();
    let tangent = angle.tan();
    alpha.powi(2) / (std::f64::consts::PI * angle.cos().powi(4) * (alpha.powi(2) + tangent.powi(2)).powi(2))
}

/// Smith's `Λ`.
fn lambda(alpha: f64, direction: Vector) -> f64 {
    let tangent = direction[2].abs().min(1.0).acos().tan();
    (-1.0 + (1.0 + (alpha * tangent).powi(2)).sqrt()) / 2.0
}

fn masking(alpha: f64, o: Vector, i: Vector) -> f64 {
    1.0 / (1.0 + lambda(alpha, o) + lambda(alpha, i))
}

fn fresnel(cosine: f64, eta: f64) -> f64 {
    let refracted = 1.0 - (1.0 - cosine * cosine) / (eta * eta);
    if refracted <= 0.0 {
        return 1.0;
    }
    let refracted = refracted.sqrt();
    let s = (cosine - eta * refracted) / (cosine + eta * refracted);
    let p = (refracted - eta * cosine) / (refracted + eta * cosine);
    (s * s + p * p) / 2.0
}

/// Value of rough glass, including transmission, for radiance.
fn glass(alpha: f64, eta: f64, o: Vector, i: Vector) -> f64 {
    if i[2] > 0.0 {
        let h = unit(std::array::from_fn(|k| o[k] + i[k]));
        return fresnel(dot(o, h), eta) * distribution(alpha, h) * masking(alpha, o, i) / (4.0 * o[2]);
    }
    let sum = unit(std::array::from_fn(|k| o[k] + eta * i[k]));
    let h = sum.map(|x| x * sum[2].signum());
    if dot(o, h) <= 0.0 || dot(i, h) >= 0.0 {
        return 0.0;
    }
    // Equation 21 with light from `i`, times the cosine of `i`; scaled from importance to radiance.
    let through = (1.0 - fresnel(dot(o, h), eta)) * distribution(alpha, h) * masking(alpha, o, i);
    let value = dot(i, h).abs() * dot(o, h) / o[2] * through * eta * eta / (dot(o, h) + eta * dot(i, h)).powi(2);
    value / (eta * eta)
}

/// Bound of the relative error of a value in single precision.
///
/// The half vector has an error of 4 units of rounding over its length before normalization; the logarithm of the
/// distribution changes by at most 2/alpha times that. Fresnel terms and facet cosines change relative to the cosine,
/// and to its square where Snell's law subtracts them.
fn error_of_facets(alpha: f64, eta: f64, outgoing: [f32; 3], incident: [f32; 3]) -> f64 {
    let (o, i) = (outgoing.map(f64::from), incident.map(f64::from));
    let sum: Vector = std::array::from_fn(|k| o[k] + eta * i[k]);
    let (h, length) = (unit(sum), dot(sum, sum).sqrt());
    let half_vector = 4.0 * f64::from(f32::EPSILON) / length;
    let critical = if incident[2] > 0.0 { 8.0 * f64::from(f32::EPSILON).sqrt() } else { 0.0 };
    half_vector * (2.0 / alpha + 4.0 / dot(o, h).powi(2) + 4.0 / dot(i, h).powi(2)) + critical
}

#[test]
fn values_match_reference_formulas() {
    for (roughness, is_inside) in [(0.3, false), (0.7, false), (1.0, false), (0.3, true), (0.7, true), (1.0, true)] {
        let bsdf = Bsdf { roughness, is_inside, transmission: 1.0, specular: 1.0, ..Bsdf::lambert([1.0; 3]) };
        let eta = if is_inside { 1.0 / f64::from(bsdf.ior) } else { f64::from(bsdf.ior) };
        let alpha = f64::from(roughness).powi(2);
        let (mut n_through, mut n_reflected) = (0, 0);
        for (square, choice) in numbers(20_000) {
            let o = outgoing(f64::from(0.1 + 0.9 * choice));
            let Some(scattered) = bsdf.sample(o, square, choice) else { continue };
            let want = glass(alpha, eta, o.map(f64::from), scattered.incident.map(f64::from));
            let got = f64::from(bsdf.evaluate(o, scattered.incident).value[0]);
            let bound = error_of_facets(alpha, if scattered.is_transmitted { eta } else { 1.0 }, o, scattered.incident);
            assert!((got - want).abs() <= bound * want.max(got), "{roughness} {is_inside}: {got} for {want}");
            if scattered.is_transmitted { n_through += 1 } else { n_reflected += 1 }
        }
        assert!(n_through > 1000 && n_reflected > 500, "{n_through} {n_reflected}");
    }
}

/// Directional albedo of single scattering by perfectly reflecting facets, by the midpoint rule over equal parts of the
/// projected facet area: `∫ G₂·(o·h)/(o·n · h·n) d(part)`.
fn albedo(alpha: f64, cosine: f64) -> f64 {
    const STEPS: u32 = 500;
    let o = [(1.0 - cosine * cosine).sqrt(), 0.0, cosine];
    let mut sum = 0.0;
    for j in 0..STEPS {
        // Denser near 1, where the steep facets visible at grazing angles are.
        let rest = ((f64::from(j) + 0.5) / f64::from(STEPS)).powi(4);
        let weight = 4.0 * ((f64::from(j) + 0.5) / f64::from(STEPS)).powi(3);
        let tangent = alpha * ((1.0 - rest) / rest).sqrt();
        let z = 1.0 / (1.0 + tangent * tangent).sqrt();
        for i in 0..STEPS {
            let (s, c) = (std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(STEPS)).sin_cos();
            let h = [tangent * z * c, tangent * z * s, z];
            let cosine = dot(o, h);
            let reflected: Vector = std::array::from_fn(|k| 2.0 * cosine * h[k] - o[k]);
            if cosine > 0.0 && reflected[2] > 0.0 {
                sum += weight * masking(alpha, o, reflected) * cosine / (o[2] * z);
            }
        }
    }
    sum / f64::from(STEPS * STEPS)
}

/// Within 1 % of quadrature everywhere, and no sample has a weight above 1.
#[test]
fn albedo_matches_single_scattering() {
    const N: u32 = 10_000;
    let sampler = Sampler::new(Pattern::Stratified, N, 3);
    for roughness in [0.1_f32, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0] {
        let metal = Bsdf { roughness, metallic: 1.0, ..Bsdf::lambert([1.0; 3]) };
        for cosine in [0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0] {
            let want = albedo(f64::from(roughness).powi(2), cosine);
            let weights = (0..N).map(|i| {
                let scattered = metal.sample(outgoing(cosine), sampler.pair(0, i, 0), 0.5);
                let weight = scattered.map_or(0.0, |scattered| scattered.weight[0]);
                // Masking and PDF share everything except sums of two roots: ten roundings.
                assert!(weight <= 1.0 + 10.0 * f32::EPSILON, "{roughness} {cosine}: {weight}");
                f64::from(weight)
            });
            let got = weights.sum::<f64>() / f64::from(N);
            assert!((got / want - 1.0).abs() < 0.01 && want < 1.0, "{roughness} {cosine}: {got} for {want}");
        }
    }
}

/// Reflection is reciprocal, and so are the base and thin-walled transmission.
#[test]
fn bsdf_is_reciprocal() {
    for roughness in [0.2, 0.5, 1.0] {
        for (name, bsdf) in materials(roughness) {
            for (square, choice) in numbers(2000) {
                let (o, through) = (outgoing(f64::from(0.2 + 0.8 * choice)), choice < 0.5);
                let i = canted_renderer::sampling::cosine_hemisphere(square);
                if i[2] < 0.2 {
                    continue;
                }
                // From the other side, z and the medium are flipped.
                let turned = |[x, y, z]: [f32; 3]| if through { [x, y, -z] } else { [x, y, z] };
                let is_inside = bsdf.is_inside != (through && !bsdf.thin_walled);
                let there = bsdf.evaluate(o, turned(i)).value[0] / i[2] * scale(&bsdf);
                let other = Bsdf { is_inside, ..bsdf };
                let back = other.evaluate(i, turned(o)).value[0] / o[2] * scale(&other);
                let alpha = f64::from(roughness).powi(2);
                let eta = if !through || bsdf.thin_walled { 1.0 } else { f64::from(relative_index(&bsdf)) };
                let facing = if bsdf.thin_walled { i } else { turned(i) };
                let bound = error_of_facets(alpha, eta, o, facing) * f64::from(there.max(back));
                assert!(f64::from((there - back).abs()) <= bound, "{name} {through}: {there} {back}");
            }
        }
    }
}

/// Refraction conserves radiance over the squared index of refraction.
fn scale(bsdf: &Bsdf) -> f32 {
    let is_dense = bsdf.is_inside && !bsdf.thin_walled;
    if is_dense { 1.0 / (bsdf.ior * bsdf.ior) } else { 1.0 }
}

fn relative_index(bsdf: &Bsdf) -> f32 {
    if bsdf.is_inside { 1.0 / bsdf.ior } else { bsdf.ior }
}

// Smooth dielectric boundaries.

const IORS: [f32; 5] = [1.0, 1.0001, 1.33, 1.5, 2.4];

fn smooth_glass(ior: f32) -> Bsdf {
    Bsdf { roughness: 0.0, specular: 1.0, transmission: 1.0, ior, ..Bsdf::lambert([1.0; 3]) }
}

/// Reflection and transmission, each selected by a choice at one end of the interval.
fn outcomes(bsdf: &Bsdf, outgoing: [f32; 3]) -> [Option<BsdfSample>; 2] {
    [0.0, 1.0 - f32::EPSILON / 2.0].map(|choice| bsdf.sample(outgoing, [0.5, 0.5], choice))
}

/// Both events are sampled in proportion to their energy: weights are 1 up to the scaling of radiance, and the
/// probabilities are the Fresnel reflectance and transmittance.
#[test]
fn reflection_and_transmission_conserve_energy() {
    for ior in IORS {
        for is_inside in [false, true] {
            let bsdf = Bsdf { is_inside, ..smooth_glass(ior) };
            let eta = if is_inside { 1.0 / ior } else { ior };
            for degree in 0..90 {
                let o = outgoing(f64::from(degree).to_radians().cos());
                for scattered in outcomes(&bsdf, o).into_iter().flatten() {
                    let radiance = if scattered.is_transmitted { 1.0 / (eta * eta) } else { 1.0 };
                    let [x, y, z] = scattered.incident;
                    assert!(scattered.is_delta && scattered.is_transmitted == (z < 0.0));
                    for weight in scattered.weight {
                        assert!((weight / radiance - 1.0).abs() <= 4.0 * f32::EPSILON, "{ior} {degree}: {weight}");
                    }
                    // Snell's law: the tangential part is divided by eta and stays in the plane.
                    let bend = if scattered.is_transmitted { eta } else { 1.0 };
                    assert!((x * bend + o[0]).abs() <= 2.0 * f32::EPSILON, "{ior} {degree}");
                    assert!((y * bend + o[1]).abs() <= 2.0 * f32::EPSILON, "{ior} {degree}");
                }
            }
        }
    }
}

#[test]
fn reflection_probability_is_fresnel_reflectance() {
    // At normal incidence ((n - 1)/(n + 1))² is 0.04, on both sides.
    for is_inside in [false, true] {
        let bsdf = Bsdf { is_inside, ..smooth_glass(1.5) };
        let is_reflected = |choice| bsdf.sample([0.0, 0.0, 1.0], [0.5; 2], choice).is_some_and(|s| !s.is_transmitted);
        assert!(is_reflected(0.039_999) && !is_reflected(0.040_001));
    }
}

#[test]
fn reflection_is_total_beyond_the_critical_angle() {
    for ior in [1.33_f32, 1.5, 2.4] {
        let critical = f64::from(1.0 / ior).asin();
        let bsdf = Bsdf { is_inside: true, ..smooth_glass(ior) };
        let transmits = |angle: f64| outcomes(&bsdf, outgoing(angle.cos()))[1].is_some_and(|s| s.is_transmitted);
        // A thousandth of a radian is well above the rounding error of the cosine.
        assert!(transmits(critical - 1e-3) && !transmits(critical + 1e-3), "{ior}");
        // Total internal reflection does not depend on the strength of the coat.
        let bare = Bsdf { specular: 0.0, ..bsdf };
        let scattered = outcomes(&bare, outgoing((critical + 1e-3).cos()))[1].unwrap();
        assert!(!scattered.is_transmitted && scattered.weight == [1.0; 3]);
    }
}

/// Follows a path through a unit sphere until it leaves; returns its throughput and the number of bounces.
fn through_sphere(bsdf: Bsdf, sampler: &Sampler, path: u32) -> Option<(f64, u32)> {
    let [a, b] = sampler.pair(path, 0, 0).map(f64::from);
    let mut normal = unit([a.sqrt(), 0.0, (1.0 - a).sqrt()]);
    // Towards the viewer, from which the sphere was hit at a random point.
    let mut to_viewer = unit([b - 0.5, 0.0, 1.0]);
    if dot(to_viewer, normal) <= 0.0 {
        return None;
    }
    let (mut throughput, mut is_inside) = (1.0, false);
    for bounce in 0..10_000 {
        let basis = canted_renderer::sampling::Basis::about(narrow(normal));
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| basis.direction(axis).map(f64::from));
        let local = narrow(unit(axes.map(|axis| dot(axis, to_viewer))));
        let square = sampler.pair(path, bounce, 1);
        let scattered = Bsdf { is_inside, ..bsdf }.sample(local, square, sampler.pair(path, bounce, 2)[0])?;
        throughput *= f64::from(scattered.weight[1]);
        is_inside ^= scattered.is_transmitted;
        if !is_inside {
            return Some((throughput, bounce));
        }
        // Continue to the next point of the sphere; the normal there points outwards, the frame inwards.
        let outwards = if scattered.is_transmitted { normal } else { normal.map(|x| -x) };
        let direction = unit(basis.direction(scattered.incident).map(f64::from));
        let chord = -2.0 * dot(direction, outwards);
        normal = unit(std::array::from_fn(|k| -(outwards[k] + chord * direction[k])));
        to_viewer = direction.map(|x| -x);
    }
    None
}

/// A clear sphere under a constant environment is invisible: every path leaves with throughput 1.
#[test]
fn clear_sphere_is_invisible_in_a_furnace() {
    let sampler = Sampler::new(Pattern::Random, 1, 9);
    for ior in IORS {
        let mut n = 0;
        for path in 0..5000 {
            let Some((throughput, bounces)) = through_sphere(smooth_glass(ior), &sampler, path) else { continue };
            // Each boundary adds at most eight roundings.
            let bound = 4.0 * f64::from(f32::EPSILON) * f64::from(bounces + 1);
            assert!((throughput - 1.0).abs() <= bound, "{ior}, {bounces} bounces: {throughput}");
            n += 1;
        }
        assert!(n > 2500, "{n}");
    }
}

/// A rough sphere loses energy between microfacets, more with higher roughness, and never gains any.
#[test]
fn rough_sphere_does_not_gain_energy() {
    const N: u32 = 20_000;
    let sampler = Sampler::new(Pattern::Random, 1, 9);
    let mut previous = 1.0;
    for roughness in [0.2, 0.5, 1.0] {
        let bsdf = Bsdf { roughness, ..smooth_glass(1.5) };
        let outside = |path: &u32| {
            let a: Vector = [f64::from(sampler.pair(*path, 0, 0)[1]) - 0.5, 0.0, 1.0];
            let s = f64::from(sampler.pair(*path, 0, 0)[0]);
            dot(unit(a), [s.sqrt(), 0.0, (1.0 - s).sqrt()]) > 0.0
        };
        let seen: Vec<f64> =
            (0..N).filter(outside).map(|path| through_sphere(bsdf, &sampler, path).map_or(0.0, |(t, _)| t)).collect();
        let n = f64::from(u32::try_from(seen.len()).unwrap());
        let mean = seen.iter().sum::<f64>() / n;
        let variance = seen.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        assert!(mean <= previous + 5.0 * (variance / n).sqrt(), "{roughness}: {mean}");
        previous = mean;
    }
}

#[test]
fn thin_wall_does_not_refract() {
    let thin = Bsdf { thin_walled: true, ..smooth_glass(1.5) };
    for degree in 0..90 {
        let o = outgoing(f64::from(degree).to_radians().cos());
        let [reflected, passed] = outcomes(&thin, o).map(Option::unwrap);
        assert_eq!((reflected.incident, passed.incident), ([-o[0], -o[1], o[2]], o.map(|x| -x)));
        assert_eq!(outcomes(&Bsdf { is_inside: true, ..thin }, o).map(Option::unwrap), [reflected, passed]);
    }
    // A rough thin wall transmits like a reflection, up to the factor.
    let frosted = Bsdf { roughness: 0.5, ..thin };
    let (o, [x, y, z]) = (outgoing(0.5), outgoing(0.8));
    let (mirrored, passed) = (frosted.evaluate(o, [x, y, z]), frosted.evaluate(o, [x, y, -z]));
    let metal = Bsdf { metallic: 1.0, ..frosted }.evaluate(o, [x, y, z]);
    let sum = mirrored.value[0] + passed.value[0];
    assert!((sum / metal.value[0] - 1.0).abs() < 4.0 * f32::EPSILON, "{sum} {metal:?}");
}

// White furnace test: no material reflects more than the incident light. Quadrature and sampling agree.

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
const ENERGY_IORS: [f32; 8] = [1.0, 1.0001, 1.01, 1.1, 1.5, 2.4, 5.0, 30.0];
const COSINES: [f64; 10] = [1.0, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1, 0.05, 0.01];

/// Without a diffuse base no sample has a weight above 1, at any roughness.
#[test]
fn facets_conserve_energy() {
    let clear = Bsdf { transmission: 1.0, specular: 1.0, ..Bsdf::lambert([1.0; 3]) };
    let kinds = [clear, Bsdf { specular: 0.4, ..clear }, Bsdf { metallic: 1.0, ..clear }];
    let kinds = kinds.into_iter().flat_map(|b| [b, Bsdf { is_inside: true, ..b }, Bsdf { thin_walled: true, ..b }]);
    for kind in kinds {
        for (roughness, ior) in ROUGHNESS.into_iter().flat_map(|roughness| ENERGY_IORS.map(|ior| (roughness, ior))) {
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
        let incident = crate::bsdf::outgoing((f64::from(i) + 0.5) / f64::from(STEPS));
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
        for ior in ENERGY_IORS {
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

// Compensation of what microfacets lose: white furnaces, and pictures by the path integrator.

const COMPENSATED_ROUGHNESS: [f32; 7] = [0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0];
const COMPENSATED_COSINES: [f64; 7] = [1.0, 0.8, 0.5, 0.3, 0.15, 0.05, 0.01];

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
    for roughness in COMPENSATED_ROUGHNESS {
        for (name, bsdf) in white(roughness) {
            for cosine in COMPENSATED_COSINES {
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

/// Rough glass from both sides, with and without the whole reflection, and over a diffuse base.
fn white_glass(roughness: f32, ior: f32) -> [(&'static str, Bsdf); 5] {
    let glass =
        Bsdf { transmission: 1.0, specular: 1.0, roughness, ior, is_compensated: true, ..Bsdf::lambert([1.0; 3]) };
    let milk = Bsdf { transmission: 0.5, ..glass };
    [
        ("glass", glass),
        ("glass from inside", Bsdf { is_inside: true, ..glass }),
        ("faint glass", Bsdf { specular: 0.3, ..glass }),
        ("milk glass", milk),
        ("milk glass from inside", Bsdf { is_inside: true, ..milk }),
    ]
}

/// A white furnace shows rough glass as bright as itself, up to the interpolation in the table of its losses; without compensation it
/// shows as little as 0.4.
#[test]
fn rough_glass_stays_white_in_a_furnace() {
    let mut darkest = 1.0_f64;
    for (roughness, ior) in COMPENSATED_ROUGHNESS.into_iter().flat_map(|r| [1.1, 1.33, 1.5, 2.4].map(|ior| (r, ior))) {
        for (name, bsdf) in white_glass(roughness, ior) {
            for cosine in COMPENSATED_COSINES {
                let (mean, error) = furnace(&bsdf, cosine);
                let allowed = 0.97 - 4.0 * error..=1.03 + 4.0 * error;
                let what = format!("{name}, roughness {roughness}, ior {ior}, cosine {cosine}: {mean} ± {error}");
                assert!(allowed.contains(&mean), "{what}");
                darkest = darkest.min(furnace(&Bsdf { is_compensated: false, ..bsdf }, cosine).0);
            }
        }
    }
    assert!(darkest < 0.4, "{darkest}");
}

/// The whole ball: its light is scattered several times inside.
#[test]
fn a_ball_of_rough_glass_is_invisible_in_a_furnace() {
    for roughness in [0.3, 1.0] {
        let [on, off] = [true, false].map(|energy_compensation| {
            let glass =
                Material { base_color: [1.0; 3], specular: 1.0, transmission: 1.0, roughness, ..Material::default() };
            let furnace = under([1.0; 3], scene(vec![sphere([0.0; 3], 1.0, 4, 0)], vec![glass]));
            let settings = Settings { integrator: Integrator::Path, energy_compensation, ..settings(8, 8, 256, 64) };
            let film = film(&furnace, &camera([2.0, 3.0, 4.0], [0.0; 3], 15.0), &settings);
            film.pixels().iter().map(|pixel: &Pixel| pixel.mean()[0]).sum::<f64>() / 64.0
        });
        assert!((0.97..=1.03).contains(&on) && off < 0.99, "{roughness}: {on} {off}");
    }
}

/// Mirrors, clear glass, and glass that does not refract are as before.
#[test]
fn other_boundaries_are_unchanged() {
    let mirror = Bsdf { metallic: 1.0, roughness: 0.0, ..Bsdf::lambert([0.9, 0.5, 0.1]) };
    let glass = Bsdf { transmission: 1.0, specular: 1.0, roughness: 0.0, ..Bsdf::lambert([1.0; 3]) };
    let straight = Bsdf { roughness: 0.5, ior: 1.001, ..glass };
    for bsdf in [mirror, glass, Bsdf { is_inside: true, ..glass }, straight] {
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
    let furnace = under([1.0; 3], scene(vec![sphere([0.0; 3], 1.0, 3, 0)], vec![metal]));
    let settings = Settings { integrator: Integrator::Path, energy_compensation, ..settings(12, 12, 64, 8) };
    let film = film(&furnace, &camera([2.0, 3.0, 4.0], [0.0; 3], 15.0), &settings);
    film.pixels().iter().map(|pixel: &Pixel| pixel.mean()[0]).sum::<f64>() / 144.0
}

#[test]
fn setting_reaches_the_path_integrator() {
    let [on, off] = [true, false].map(picture);
    assert!((0.98..=1.02).contains(&on) && off < 0.8, "{on} {off}");
}
