//! Tests of the BSDF against quadrature in `f64`, textbook formulas and sample counts.
//!
//! All but `compensation` are about single scattering between microfacets.

mod compensation;
mod density;
mod dielectric;
mod energy;
mod extremes;
mod ggx;
mod lobes;

use canted_renderer::sampling::Basis;
use canted_renderer::{Bsdf, Pattern, Sampler};

use crate::common::{Vector, narrow};

/// One material of each kind, then mixtures.
fn materials(roughness: f32) -> Vec<(&'static str, Bsdf)> {
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
fn outgoing(cosine: f64) -> [f32; 3] {
    let sine = (1.0 - cosine * cosine).sqrt();
    narrow([0.6 * sine, -0.8 * sine, cosine])
}

/// Independent points of the unit square and choices.
fn numbers(n: u32) -> impl Iterator<Item = ([f32; 2], f32)> {
    let sampler = Sampler::new(Pattern::Random, n, 11);
    (0..n).map(move |i| (sampler.pair(i, 0, 0), sampler.pair(i, 0, 1)[0]))
}

/// Undoes the scaling of radiance by refraction, so that flux remains.
fn flux_factor(bsdf: &Bsdf, is_transmitted: bool) -> f64 {
    let ior = f64::from(bsdf.ior);
    match (is_transmitted && !bsdf.thin_walled, bsdf.is_inside) {
        (false, _) => 1.0,
        (true, false) => ior * ior,
        (true, true) => 1.0 / (ior * ior),
    }
}

/// Steps of a quadrature along the angle from an axis and around it.
type Steps = [u32; 2];

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
fn flux(bsdf: &Bsdf, outgoing: [f32; 3], steps: Steps) -> Vector {
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
