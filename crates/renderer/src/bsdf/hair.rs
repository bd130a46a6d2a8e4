//! Light that a hair scatters: the BSDF of Chiang et al. 2016, *A Practical and Controllable Hair and Fur Model for Production Path Tracing*, in the
//! form of pbrt-v4 (Pharr, Jakob and Humphreys, section 9.9).
//!
//! A hair is a dielectric cylinder with scales and an absorbing medium. Light leaves it after `p` inner paths: reflected (0), transmitted
//! (1), after an inner reflection (2), and after more (the last term). Each term is a product of a longitudinal lobe, an attenuation and
//! an azimuthal lobe.
//!
//! The hair is a tube here, so the offset across it follows from the normal. Where light leaves on the far side, the ray continues from the
//! point of entry and passes the tube that it is in ([`HitFilter`](crate::HitFilter)), as the BSDF is that of the whole tube.

use canted_scene::Hair as Source;

use super::{BsdfSample, Evaluation};

/// Terms with a lobe of their own.
const N_LOBES: usize = 3;

/// A hair at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hair {
    /// Absorption per radius of the hair, linear RGB.
    pub absorption: [f32; 3],
    /// Roughness along the hair, 0..=1.
    pub roughness: f32,
    /// Roughness around the hair, 0..=1.
    pub roughness_around: f32,
    /// Angle of the scales, radians.
    pub tilt_rad: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Direction of the hair in the tangent plane of the frame, a unit vector.
    pub direction: [f32; 2],
}

impl Hair {
    /// The hair of a material with this color.
    pub(crate) fn new(source: &Source, base_color: [f32; 3], ior: f32) -> Self {
        let of_melanin = |eumelanin: f32, pheomelanin: f32| {
            // Concentrations to absorption: d'Eon et al. 2011, as in pbrt-v4.
            let (dark, red) = ([0.419, 0.697, 1.37], [0.187, 0.4, 1.05]);
            std::array::from_fn(|k| eumelanin * dark[k] + pheomelanin * red[k])
        };
        let b = source.roughness_around;
        let of_color = |c: f32| (c.clamp(1e-4, 1.0).ln() / Self::color_scale(b)).powi(2);
        let absorption = if source.melanin > 0.0 || source.pheomelanin > 0.0 {
            of_melanin(source.melanin, source.pheomelanin)
        } else {
            base_color.map(of_color)
        };
        Self {
            absorption,
            roughness: source.roughness,
            roughness_around: b,
            tilt_rad: source.tilt_degrees.to_radians(),
            ior,
            direction: [1.0, 0.0],
        }
    }

    /// The divisor of the logarithm of the color whose square is the absorption, for a roughness around the hair: the fit of Chiang et al., equation 9.
    pub(crate) fn color_scale(b: f32) -> f32 {
        5.969 - 0.215 * b + 2.532 * b.powi(2) - 10.73 * b.powi(3) + 5.574 * b.powi(4) + 0.245 * b.powi(5)
    }

    /// Evaluates the BSDF times the cosine of `incident`. The frame is that of [`Bsdf`](super::Bsdf), `x` along the hair.
    pub(super) fn evaluate(&self, outgoing: [f32; 3], incident: [f32; 3]) -> Evaluation {
        let lobes = Lobes::new(self, outgoing);
        let (value, density) = lobes.evaluate(incident.map(f64::from));
        let is_usable = density.is_finite() && value.iter().all(|x| x.is_finite());
        if is_usable {
            Evaluation { value: value.map(|x| x as f32), density: density as f32 }
        } else {
            Evaluation::default()
        }
    }

    pub(super) fn sample(&self, outgoing: [f32; 3], square: [f32; 2], choice: f32) -> Option<BsdfSample> {
        let lobes = Lobes::new(self, outgoing);
        let incident = lobes.sample(square.map(f64::from), choice.into()).map(|x| x as f32);
        let Evaluation { value, density } = self.evaluate(outgoing, incident);
        (density > 0.0).then(|| BsdfSample {
            incident,
            weight: value.map(|x| x / density),
            density,
            is_delta: false,
            is_transmitted: incident[2] < 0.0,
        })
    }
}

/// The lobes for one direction to the viewer.
struct Lobes {
    /// Azimuth of the viewer, and of the normal relative to it.
    phi: f64,
    gamma: f64,
    gamma_inner: f64,
    /// Sine and cosine of the elevation of each lobe, tilted by the scales.
    elevations: [[f64; 2]; N_LOBES + 1],
    /// Longitudinal variances.
    variances: [f64; N_LOBES + 1],
    /// Scale of the azimuthal logistic distributions.
    scale: f64,
    /// Attenuation of each term, per channel.
    attenuations: [[f64; 3]; N_LOBES + 1],
}

fn safe_sqrt(x: f64) -> f64 {
    x.max(0.0).sqrt()
}

impl Lobes {
    fn new(hair: &Hair, outgoing: [f32; 3]) -> Self {
        let [x, y, z] = outgoing.map(f64::from);
        let (b, n) = (f64::from(hair.roughness), f64::from(hair.roughness_around));
        let variance = (0.726 * b + 0.812 * b * b + 3.7 * b.powi(20)).powi(2).max(1e-6);
        let variances = [variance, 0.25 * variance, 4.0 * variance, 4.0 * variance];
        let scale = (0.626_657_069 * (0.265 * n + 1.194 * n * n + 5.372 * n.powi(22))).max(1e-3);
        let (sine, cosine) = (x.clamp(-1.0, 1.0), safe_sqrt(1.0 - x * x));
        // The normal is z: the azimuth of the viewer from it is the angle at which light meets the circle.
        let phi = z.atan2(y);
        let gamma = phi - std::f64::consts::FRAC_PI_2;
        let offset = gamma.sin();
        let ior = f64::from(hair.ior).max(1.0 + 1e-4);
        let inner_cosine = safe_sqrt(1.0 - (sine / ior).powi(2));
        // The index of refraction in the plane across the hair.
        let across = safe_sqrt(ior * ior - sine * sine) / cosine.max(1e-9);
        let inner_offset = (offset / across).clamp(-1.0, 1.0);
        let way = 2.0 * safe_sqrt(1.0 - inner_offset * inner_offset) / inner_cosine;
        let reflectance = fresnel(cosine * safe_sqrt(1.0 - offset * offset), ior);
        let mut attenuations = [[0.0; 3]; N_LOBES + 1];
        for (channel, &absorption) in hair.absorption.iter().enumerate() {
            let passed = (-f64::from(absorption) * way).exp();
            let first = (1.0 - reflectance).powi(2) * passed;
            let second = first * passed * reflectance;
            let rest = second * passed * reflectance / (1.0 - passed * reflectance).max(1e-9);
            for (of_lobe, value) in attenuations.iter_mut().zip([reflectance, first, second, rest]) {
                of_lobe[channel] = value;
            }
        }
        let tilted = |angle: f64| {
            let (s, c) = angle.sin_cos();
            [sine * c - cosine * s, (cosine * c + sine * s).abs()]
        };
        let tilt = f64::from(hair.tilt_rad);
        let elevations = [tilted(2.0 * tilt), tilted(-tilt), tilted(-4.0 * tilt), [sine, cosine]];
        Self { phi, gamma, gamma_inner: inner_offset.asin(), elevations, variances, scale, attenuations }
    }

    /// Azimuth after `p` inner paths, relative to the viewer.
    fn turn(&self, p: usize) -> f64 {
        let p = p as f64;
        2.0 * p * self.gamma_inner - 2.0 * self.gamma + p * std::f64::consts::PI
    }

    /// How probable each lobe is in samples: its mean attenuation.
    fn probabilities(&self) -> [f64; N_LOBES + 1] {
        let means = self.attenuations.map(|of_lobe| of_lobe.iter().sum::<f64>().max(1e-12));
        let sum: f64 = means.iter().sum();
        means.map(|mean| mean / sum)
    }

    /// Value times cosine, and density.
    fn evaluate(&self, [x, y, z]: [f64; 3]) -> ([f64; 3], f64) {
        let (sine, cosine) = (x.clamp(-1.0, 1.0), safe_sqrt(1.0 - x * x));
        let phi = z.atan2(y) - self.phi;
        let probabilities = self.probabilities();
        let (mut value, mut density) = ([0.0; 3], 0.0);
        for (p, &probability) in probabilities.iter().enumerate() {
            let along = longitudinal([sine, cosine], self.elevations[p], self.variances[p]);
            let around = if p < N_LOBES {
                trimmed_logistic(wrapped(phi - self.turn(p)), self.scale)
            } else {
                0.5 * std::f64::consts::FRAC_1_PI
            };
            density += probability * along * around;
            for (sum, attenuation) in value.iter_mut().zip(self.attenuations[p]) {
                *sum += attenuation * along * around;
            }
        }
        (value, density)
    }

    fn sample(&self, [u, v]: [f64; 2], choice: f64) -> [f64; 3] {
        use std::f64::consts::{PI, TAU};
        let probabilities = self.probabilities();
        let (mut p, mut rest) = (0, choice);
        while p < N_LOBES && rest >= probabilities[p] {
            rest -= probabilities[p];
            p += 1;
        }
        // What is left of the choice is uniform again.
        let rest = (rest / probabilities[p]).clamp(0.0, 1.0 - f64::EPSILON);
        let ([s, c], variance) = (self.elevations[p], self.variances[p]);
        let up = (1.0 + variance * (u.max(1e-9) + (1.0 - u) * (-2.0 / variance).exp()).ln()).clamp(-1.0, 1.0);
        let sine = (-up * s + safe_sqrt(1.0 - up * up) * (TAU * v).cos() * c).clamp(-1.0, 1.0);
        let cosine = safe_sqrt(1.0 - sine * sine);
        let turn = if p < N_LOBES {
            let [low, high] = [-PI, PI].map(|x| logistic_cdf(x, self.scale));
            let part = (rest * (high - low) + low).clamp(1e-12, 1.0 - 1e-12);
            self.turn(p) + (-self.scale * (1.0 / part - 1.0).ln()).clamp(-PI, PI)
        } else {
            TAU * rest
        };
        let phi = self.phi + turn;
        [sine, cosine * phi.cos(), cosine * phi.sin()]
    }
}

/// Reflectance of a dielectric boundary from outside.
fn fresnel(cosine: f64, ior: f64) -> f64 {
    let inner = safe_sqrt(1.0 - (1.0 - cosine * cosine) / (ior * ior));
    let parallel = (ior * cosine - inner) / (ior * cosine + inner);
    let across = (cosine - ior * inner) / (cosine + ior * inner);
    0.5 * (parallel * parallel + across * across)
}

/// An angle moved into -pi..=pi.
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}

fn logistic_cdf(x: f64, scale: f64) -> f64 {
    1.0 / (1.0 + (-x / scale).exp())
}

/// The logistic distribution on -pi..=pi.
fn trimmed_logistic(x: f64, scale: f64) -> f64 {
    let e = (-(x.abs()) / scale).exp();
    let inside = logistic_cdf(std::f64::consts::PI, scale) - logistic_cdf(-std::f64::consts::PI, scale);
    e / (scale * (1.0 + e) * (1.0 + e)) / inside
}

/// The longitudinal lobe of a variance (d'Eon et al. 2011), for sines and cosines of both elevations.
fn longitudinal([s, c]: [f64; 2], [so, co]: [f64; 2], variance: f64) -> f64 {
    let (a, b) = (c * co / variance, s * so / variance);
    if variance <= 0.1 {
        (log_i0(a) - b - 1.0 / variance + std::f64::consts::LN_2 + (0.5 / variance).ln()).exp()
    } else {
        (-b).exp() * i0(a) / ((1.0 / variance).sinh() * 2.0 * variance)
    }
}

/// The modified Bessel function of the first kind and order 0, by its series.
fn i0(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut sum, mut term) = (1.0, 1.0);
    for k in 1..40_u32 {
        term *= quarter / f64::from(k * k);
        sum += term;
    }
    sum
}

fn log_i0(x: f64) -> f64 {
    if x > 12.0 { x + 0.5 * (-(std::f64::consts::TAU).ln() - x.ln() + 1.0 / (4.0 * x)) } else { i0(x).ln() }
}
