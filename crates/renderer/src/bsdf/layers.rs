//! Layers over the base: fibers and a clear coat.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use glam::Vec3;

use super::boundary::{Boundary, Choice};
use super::lobes::Lobes;
use super::microfacet::{mean, unit};
use super::{Bsdf, BsdfSample, Evaluation, MIN_COSINE, Scatterer};

/// Layers seen from one direction.
pub(crate) struct Layers<'a> {
    base: Boundary<'a>,
    coat: Option<Boundary<'a>>,
    fibers: Fibers,
    /// Color of the fibers, at most what conserves energy.
    sheen: [f32; 3],
    outgoing: Vec3,
    /// Parts of the light that reach the coat and the base.
    passed: [f32; 2],
    /// Probabilities of sampling fibers, coat and base.
    probabilities: [f32; 3],
}

/// The coat as a BSDF of its own: a reflection over black.
fn coat_of(bsdf: &Bsdf, lobes: &Lobes) -> Bsdf {
    Bsdf {
        roughness: lobes.clearcoat_roughness,
        specular: lobes.clearcoat,
        is_compensated: bsdf.is_compensated,
        hemisphere: bsdf.hemisphere,
        ..Bsdf::lambert([0.0; 3])
    }
}

impl<'a> Layers<'a> {
    /// `lobes` are those of the BSDF.
    pub(super) fn new(bsdf: &Bsdf, lobes: &'a Lobes, outgoing: Vec3) -> Self {
        /// Dark bases still reflect at grazing angles.
        const MIN_ALBEDO: f32 = 0.1;
        let fibers = Fibers::new(lobes.sheen_roughness);
        let albedo = fibers.albedo(outgoing.z);
        let strongest = lobes.sheen_color.into_iter().fold(0.0, f32::max);
        let scale = (strongest * albedo).max(1.0).recip();
        let sheen = lobes.sheen_color.map(|c| c * scale);
        // Not above 1 by rounding.
        let of_fibers = (strongest * scale * albedo).min(1.0);
        let base = Boundary::new(bsdf, Some(lobes), outgoing);
        let coat = (lobes.clearcoat > 0.0).then(|| Boundary::new(&coat_of(bsdf, lobes), None, outgoing));
        let of_coat = coat.as_ref().map_or(0.0, |coat| coat.coat_albedo(outgoing.z));
        let passed = [1.0 - of_fibers, (1.0 - of_fibers) * (1.0 - of_coat)];
        let shares = [of_fibers, passed[0] * of_coat, passed[1] * mean(bsdf.albedo()).max(MIN_ALBEDO)];
        let sum: f32 = shares.iter().sum();
        Self { base, coat, fibers, sheen, outgoing, passed, probabilities: shares.map(|share| share / sum) }
    }
}

impl Scatterer for Layers<'_> {
    fn evaluate(&self, incident: Vec3) -> Evaluation {
        let [to_coat, to_base] = self.passed;
        let [of_fibers, of_coat, of_base] = self.probabilities;
        let mut total = Evaluation::default();
        let mut add = |part: Evaluation, factor: f32, probability: f32| {
            total.value = (Vec3::from(total.value) + factor * Vec3::from(part.value)).into();
            total.density += probability * part.density;
        };
        add(self.base.evaluate(incident), to_base, of_base);
        if incident.z > 0.0 {
            if let Some(coat) = &self.coat {
                add(coat.evaluate(incident), to_coat, of_coat);
            }
            if of_fibers > 0.0 {
                let value = self.fibers.evaluate(self.outgoing, incident);
                add(Evaluation { value: self.sheen.map(|c| c * value), density: 1.0 / TAU }, 1.0, of_fibers);
            }
        }
        total
    }

    fn sample(&self, square: [f32; 2], choice: f32) -> Option<Choice> {
        let [of_fibers, of_coat, of_base] = self.probabilities;
        if choice < of_fibers {
            // Uniform: most of the sheen is near the horizon.
            let z = square[0].max(MIN_COSINE);
            let radius = (1.0 - z * z).max(0.0).sqrt();
            let (sine, cosine) = (TAU * square[1]).sin_cos();
            return Some(Choice::Direction(Vec3::new(radius * cosine, radius * sine, z)));
        }
        let rest = choice - of_fibers;
        let (boundary, factor, probability, rest) = match &self.coat {
            Some(coat) if rest < of_coat => (coat, self.passed[0], of_coat, rest),
            _ => (&self.base, self.passed[1], of_base, rest - of_coat),
        };
        // Rescales the random number for the next choice.
        let choice = (rest / probability).clamp(0.0, 1.0 - f32::EPSILON);
        Some(match boundary.sample(square, choice)? {
            Choice::Direction(incident) => Choice::Direction(incident),
            Choice::Delta(sample) => {
                let factor = factor / probability;
                Choice::Delta(BsdfSample { weight: sample.weight.map(|w| w * factor), ..sample })
            }
        })
    }
}

// Fibers of a cloth: the distribution of Estevez and Kulla 2017 (*Production Friendly Microfacet Sheen BRDF*), with the visibility
// of Neubelt and Pettineo 2013, as `KHR_materials_sheen` recommends.

/// The least roughness: smoother fibers are a line at the horizon that no sampling finds.
const MIN_ROUGHNESS: f32 = 0.07;

/// Fibers of one roughness, white.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fibers {
    roughness: f32,
    inverse_alpha: f32,
}

impl Fibers {
    pub(super) fn new(roughness: f32) -> Self {
        let roughness = roughness.clamp(MIN_ROUGHNESS, 1.0);
        Self { roughness, inverse_alpha: 1.0 / (roughness * roughness) }
    }

    /// The BRDF times the cosine of `incident`; both directions are above the horizon.
    pub(super) fn evaluate(self, outgoing: Vec3, incident: Vec3) -> f32 {
        let half = unit(outgoing + incident);
        let sine = (half.x * half.x + half.y * half.y).sqrt().min(1.0);
        let distribution = (2.0 + self.inverse_alpha) * sine.powf(self.inverse_alpha) / TAU;
        let (o, i) = (outgoing.z, incident.z);
        // The quotient of cosines is at most 1, however small they are.
        distribution * (0.25 * i / (o + i - o * i))
    }

    /// The part of the light from all directions that is reflected to a direction with this cosine.
    pub(super) fn albedo(self, cosine: f32) -> f32 {
        let at = |x: f32, n: usize| {
            let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
            let i = (x as usize).min(n - 2);
            let rest = x - i as f32;
            (i, rest)
        };
        let (row, y) = at((self.roughness - MIN_ROUGHNESS) / (1.0 - MIN_ROUGHNESS), N_ROUGHNESS);
        let (column, x) = at(cosine.max(0.0).sqrt(), N_COSINES);
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let of_row = |row: usize| mix(ALBEDO[row][column], ALBEDO[row][column + 1], x);
        mix(of_row(row), of_row(row + 1), y)
    }
}

const N_ROUGHNESS: usize = 24;
const N_COSINES: usize = 24;

/// Albedos by roughness and by the root of the cosine, which resolves grazing directions.
static ALBEDO: LazyLock<[[f32; N_COSINES]; N_ROUGHNESS]> = LazyLock::new(|| {
    std::array::from_fn(|row| {
        let roughness = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * row as f32 / (N_ROUGHNESS - 1) as f32;
        std::array::from_fn(|column| {
            let root = column as f32 / (N_COSINES - 1) as f32;
            integrated(Fibers::new(roughness), root * root)
        })
    })
});

/// The albedo by the midpoint rule. At the horizon the value stands for directions near it.
fn integrated(fibers: Fibers, cosine: f32) -> f32 {
    const N_HEIGHTS: u16 = 48;
    const N_ANGLES: u16 = 24;
    let cosine = cosine.max(1e-4);
    let outgoing = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    let mut sum = 0.0;
    for i in 0..N_HEIGHTS {
        // Denser at the horizon: the cosine is the square of a uniform number.
        let root = (f32::from(i) + 0.5) / f32::from(N_HEIGHTS);
        let z = root * root;
        let radius = (1.0 - z * z).sqrt();
        for j in 0..N_ANGLES {
            let (sine, cosine) = (PI * (f32::from(j) + 0.5) / f32::from(N_ANGLES)).sin_cos();
            sum += 2.0 * root * fibers.evaluate(outgoing, Vec3::new(radius * cosine, radius * sine, z));
        }
    }
    // Both halves of the circle.
    TAU * sum / (f32::from(N_HEIGHTS) * f32::from(N_ANGLES))
}
