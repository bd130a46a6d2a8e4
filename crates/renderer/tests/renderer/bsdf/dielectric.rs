//! Smooth dielectric boundaries.

use canted_renderer::{Bsdf, BsdfSample, Pattern, Sampler};

use super::outgoing;
use crate::common::{Vector, dot, narrow, unit};

const IORS: [f32; 5] = [1.0, 1.0001, 1.33, 1.5, 2.4];

fn glass(ior: f32) -> Bsdf {
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
            let bsdf = Bsdf { is_inside, ..glass(ior) };
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
        let bsdf = Bsdf { is_inside, ..glass(1.5) };
        let is_reflected = |choice| bsdf.sample([0.0, 0.0, 1.0], [0.5; 2], choice).is_some_and(|s| !s.is_transmitted);
        assert!(is_reflected(0.039_999) && !is_reflected(0.040_001));
    }
}

#[test]
fn reflection_is_total_beyond_the_critical_angle() {
    for ior in [1.33_f32, 1.5, 2.4] {
        let critical = f64::from(1.0 / ior).asin();
        let bsdf = Bsdf { is_inside: true, ..glass(ior) };
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
            let Some((throughput, bounces)) = through_sphere(glass(ior), &sampler, path) else { continue };
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
        let bsdf = Bsdf { roughness, ..glass(1.5) };
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
    let thin = Bsdf { thin_walled: true, ..glass(1.5) };
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
