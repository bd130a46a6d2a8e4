//! GGX compared with an implementation in `f64` from angles, after Walter et al. 2007 and Heitz 2014.

use canted_renderer::{Bsdf, Pattern, Sampler};

use super::{numbers, outgoing};
use crate::common::{Vector, dot, unit};

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
        for (name, bsdf) in super::materials(roughness) {
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
