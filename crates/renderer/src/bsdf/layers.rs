//! Layers over the base: fibers and a clear coat.

use std::f32::consts::TAU;

use super::boundary::{Boundary, Choice};
use super::sheen::Fibers;
use super::vector::mean;
use super::{Bsdf, BsdfSample, Evaluation, Lobes, MIN_COSINE, Scatterer};

/// Layers seen from one direction.
pub(super) struct Layers<'a> {
    base: Boundary<'a>,
    coat: Option<Boundary<'a>>,
    fibers: Fibers,
    /// Color of the fibers, at most what conserves energy.
    sheen: [f32; 3],
    outgoing: [f32; 3],
    /// Parts of the light that reach the coat and the base.
    passed: [f32; 2],
    /// Probabilities of sampling fibers, coat and base.
    probabilities: [f32; 3],
}

/// The coat as a BSDF of its own: a reflection over black.
pub(super) fn coat_of(bsdf: &Bsdf, lobes: &Lobes) -> Bsdf {
    Bsdf {
        roughness: lobes.clearcoat_roughness,
        specular: lobes.clearcoat,
        is_compensated: bsdf.is_compensated,
        ..Bsdf::lambert([0.0; 3])
    }
}

impl<'a> Layers<'a> {
    /// `coat` is [`coat_of`] the BSDF.
    pub(super) fn new(bsdf: &'a Bsdf, coat: &'a Bsdf, lobes: &Lobes, outgoing: [f32; 3]) -> Self {
        /// Dark bases still reflect at grazing angles.
        const MIN_ALBEDO: f32 = 0.1;
        let fibers = Fibers::new(lobes.sheen_roughness);
        let albedo = fibers.albedo(outgoing[2]);
        let strongest = lobes.sheen_color.into_iter().fold(0.0, f32::max);
        let scale = (strongest * albedo).max(1.0).recip();
        let sheen = lobes.sheen_color.map(|c| c * scale);
        // Not above 1 by rounding.
        let of_fibers = (strongest * scale * albedo).min(1.0);
        let base = Boundary::new(bsdf, outgoing);
        let coat = (lobes.clearcoat > 0.0).then(|| Boundary::new(coat, outgoing));
        let of_coat = coat.as_ref().map_or(0.0, |coat| coat.coat_albedo(outgoing[2]));
        let passed = [1.0 - of_fibers, (1.0 - of_fibers) * (1.0 - of_coat)];
        let shares = [of_fibers, passed[0] * of_coat, passed[1] * mean(bsdf.albedo()).max(MIN_ALBEDO)];
        let sum: f32 = shares.iter().sum();
        Self { base, coat, fibers, sheen, outgoing, passed, probabilities: shares.map(|share| share / sum) }
    }
}

impl Scatterer for Layers<'_> {
    fn evaluate(&self, incident: [f32; 3]) -> Evaluation {
        let [to_coat, to_base] = self.passed;
        let [of_fibers, of_coat, of_base] = self.probabilities;
        let mut total = Evaluation::default();
        let mut add = |part: Evaluation, factor: f32, probability: f32| {
            total.value = std::array::from_fn(|k| total.value[k] + factor * part.value[k]);
            total.density += probability * part.density;
        };
        add(self.base.evaluate(incident), to_base, of_base);
        if incident[2] > 0.0 {
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
            return Some(Choice::Direction([radius * cosine, radius * sine, z]));
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
