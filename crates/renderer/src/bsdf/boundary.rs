//! The boundary seen from one direction: its base, its layer, and with which probability each is sampled.

use std::f32::consts::PI;

use super::ggx::{Ggx, reflect};
use super::vector::{dot, mean, unit};
use super::{Bsdf, BsdfSample, Evaluation, MIN_COSINE, fresnel};
use crate::sampling::cosine_hemisphere;

/// The least difference of `eta` from 1 that bends light of a rough boundary; below, it passes straight.
///
/// A half vector is the sum of vectors that then nearly cancel, and has an error of 2⁻²³ over this difference: 1/64
/// of the width of the narrowest lobe.
const MIN_IOR_STEP: f32 = 1.0 / 128.0;

/// A material from one outgoing direction.
pub(super) struct Boundary<'a> {
    bsdf: &'a Bsdf,
    outgoing: [f32; 3],
    is_inside: bool,
    /// Index of the far side over that of the side of `outgoing`.
    eta: f32,
    /// `None` for a mirror.
    facets: Option<Ggx>,
    diffuse_probability: f32,
}

/// What a facet does with the light of one direction.
struct Facet {
    reflected: [f32; 3],
    transmitted: [f32; 3],
    /// That a sample which found this facet is reflected; the rest is transmitted.
    reflection_probability: f32,
}

/// A sampled direction, and for one that only a mirror or a clear boundary makes all there is to know.
pub(super) enum Choice {
    Direction([f32; 3]),
    Mirrored(BsdfSample),
}

impl<'a> Boundary<'a> {
    pub(super) fn new(bsdf: &'a Bsdf, outgoing: [f32; 3]) -> Self {
        let is_inside = bsdf.is_inside && bsdf.transmission > 0.0 && !bsdf.thin_walled;
        let eta = if is_inside { 1.0 / bsdf.ior } else { bsdf.ior };
        let facets = Ggx::of_roughness(bsdf.roughness);
        let mut boundary = Self { bsdf, outgoing, is_inside, eta, facets, diffuse_probability: 0.0 };
        boundary.diffuse_probability = boundary.share_of_base();
        boundary
    }

    /// What comes from `incident`, whose z is not 0.
    pub(super) fn evaluate(&self, incident: [f32; 3]) -> Evaluation {
        if incident[2] > 0.0 { self.reflected(incident) } else { self.transmitted(incident) }
    }

    /// Light that leaves on the side it came from.
    fn reflected(&self, incident: [f32; 3]) -> Evaluation {
        let lambert = incident[2] / PI;
        let base = self.base(incident[2]);
        let diffuse = Evaluation { value: base.map(|c| c * lambert), density: self.diffuse_probability * lambert };
        let Some(facets) = self.facets else { return diffuse };
        let gloss = self.mirrored(facets, incident, |facet| (facet.reflected, facet.reflection_probability));
        Evaluation {
            value: std::array::from_fn(|k| diffuse.value[k] + gloss.value[k]),
            density: diffuse.density + gloss.density,
        }
    }

    /// Light that comes through.
    fn transmitted(&self, incident: [f32; 3]) -> Evaluation {
        match self.facets {
            Some(facets) if self.bsdf.transmission > 0.0 => {
                let [x, y, z] = incident;
                if self.bsdf.thin_walled {
                    self.mirrored(facets, [x, y, -z], |facet| (facet.transmitted, 1.0 - facet.reflection_probability))
                } else {
                    self.refracted(facets, incident)
                }
            }
            _ => Evaluation::default(),
        }
    }

    /// Facets that mirror `incident` into `outgoing`, with a share of the light and of the samples.
    fn mirrored(&self, facets: Ggx, incident: [f32; 3], part: impl Fn(&Facet) -> ([f32; 3], f32)) -> Evaluation {
        let normal = unit(std::array::from_fn(|k| self.outgoing[k] + incident[k]));
        let (color, probability) = part(&self.facet(dot(self.outgoing, normal)));
        let area = facets.distribution(normal) * facets.masking(self.outgoing[2], incident[2]);
        // Four times the cosine to the facet is the stretch of normals to directions; the cosine cancels.
        let density = facets.density(self.outgoing[2], normal) / 4.0;
        Evaluation { value: color.map(|c| c * area), density: (1.0 - self.diffuse_probability) * probability * density }
    }

    /// Facets that refract `incident` into `outgoing`, after Walter et al. 2007, equations 16, 17 and 21.
    fn refracted(&self, facets: Ggx, incident: [f32; 3]) -> Evaluation {
        if !self.bends() {
            return Evaluation::default();
        }
        // It lies along no + eta·ni, on the side of the thinner medium.
        let sum = unit(std::array::from_fn(|k| self.outgoing[k] + self.eta * incident[k]));
        let normal = if sum[2] < 0.0 { sum.map(|x| -x) } else { sum };
        let (near, far) = (dot(self.outgoing, normal), dot(incident, normal));
        if near <= 0.0 || far >= 0.0 {
            return Evaluation::default();
        }
        let facet = self.facet(near);
        // The stretch of normals to directions; by Snell's law the sum is at least 1 - 1/eta, absolute.
        let stretch = -far / (far + near / self.eta).powi(2);
        let masking = 4.0 * near * facets.masking(self.outgoing[2], -incident[2]);
        let area = facets.distribution(normal) * masking * stretch / (self.eta * self.eta);
        let density = near * facets.density(self.outgoing[2], normal) * stretch;
        let probability = (1.0 - self.diffuse_probability) * (1.0 - facet.reflection_probability);
        Evaluation { value: facet.transmitted.map(|c| c * area), density: probability * density }
    }

    /// A direction by one of the lobes; `None` where a facet sends the light to another facet.
    pub(super) fn sample(&self, square: [f32; 2], choice: f32) -> Option<Choice> {
        if choice < self.diffuse_probability {
            return Some(Choice::Direction(cosine_hemisphere(square)));
        }
        // What is left of the number chooses once more.
        let choice = (choice - self.diffuse_probability) / (1.0 - self.diffuse_probability);
        let normal = self.facets.map_or([0.0, 0.0, 1.0], |facets| facets.sample(self.outgoing, square));
        let facet = self.facet(dot(self.outgoing, normal));
        if choice < facet.reflection_probability { self.reflect(&facet, normal) } else { self.transmit(&facet, normal) }
    }

    fn reflect(&self, facet: &Facet, normal: [f32; 3]) -> Option<Choice> {
        if self.facets.is_none() {
            let [x, y, z] = self.outgoing;
            return self.mirror([-x, -y, z], facet.reflected, facet.reflection_probability);
        }
        let incident = reflect(self.outgoing, normal);
        (incident[2] >= MIN_COSINE).then_some(Choice::Direction(incident))
    }

    fn transmit(&self, facet: &Facet, normal: [f32; 3]) -> Option<Choice> {
        let probability = 1.0 - facet.reflection_probability;
        if self.bsdf.thin_walled {
            if self.facets.is_none() {
                return self.mirror(self.outgoing.map(|x| -x), facet.transmitted, probability);
            }
            let [x, y, z] = reflect(self.outgoing, normal);
            return (z >= MIN_COSINE).then_some(Choice::Direction([x, y, -z]));
        }
        let color = facet.transmitted.map(|c| c / (self.eta * self.eta));
        if self.facets.is_some() && !self.bends() {
            return self.mirror(self.outgoing.map(|x| -x), color, probability);
        }
        let cosine = dot(self.outgoing, normal);
        let refracted = fresnel::refracted_cosine(cosine, self.eta)?;
        // Snell's law divides the tangential part by eta, and its error if the far side is the thinner.
        let tangent = |k: usize| self.outgoing[k] - cosine * normal[k];
        let incident = unit(std::array::from_fn(|k| -tangent(k) / self.eta - refracted * normal[k]));
        if self.facets.is_none() {
            return self.mirror(incident, color, probability);
        }
        (incident[2] <= -MIN_COSINE).then_some(Choice::Direction(incident))
    }

    /// The only direction of its lobe.
    fn mirror(&self, incident: [f32; 3], color: [f32; 3], probability: f32) -> Option<Choice> {
        let probability = probability * (1.0 - self.diffuse_probability);
        let weight = color.map(|c| c / probability);
        let is_transmitted = incident[2] < 0.0;
        (probability > 0.0).then_some(Choice::Mirrored(BsdfSample {
            incident,
            weight,
            density: 0.0,
            is_delta: true,
            is_transmitted,
        }))
    }

    /// Whether a rough boundary bends light by more than rounding does.
    fn bends(&self) -> bool {
        (self.eta - 1.0).abs() >= MIN_IOR_STEP
    }

    fn facet(&self, cosine: f32) -> Facet {
        let Bsdf { base_color, metallic, transmission, .. } = *self.bsdf;
        // Rounding may leave the cosine just outside.
        let cosine = cosine.clamp(0.0, 1.0);
        let layer = self.layer(cosine);
        let gloss = (1.0 - metallic) * layer * if self.is_inside { transmission } else { 1.0 };
        let reflected = base_color.map(|c| metallic * fresnel::schlick(cosine, c) + gloss);
        let through = (1.0 - metallic) * transmission * (1.0 - layer);
        let transmitted = base_color.map(|c| through * c);
        let (r, t) = (mean(reflected), mean(transmitted));
        Facet { reflected, transmitted, reflection_probability: if t > 0.0 { r / (r + t) } else { 1.0 } }
    }

    /// Albedo of the diffuse base under the layer, for light of this cosine; from inside it lies before the layer.
    fn base(&self, incident: f32) -> [f32; 3] {
        let color = self.bsdf.diffuse_color();
        if self.is_inside {
            return color;
        }
        let passed = (1.0 - self.layer(self.outgoing[2])) * (1.0 - self.layer(incident));
        let mean = 1.0 - self.bsdf.specular * fresnel::mean_below(self.eta);
        color.map(|c| c * passed / mean)
    }

    /// What the layer of a non-metal reflects; total reflection is total at any strength.
    fn layer(&self, cosine: f32) -> f32 {
        fresnel::dielectric(cosine, self.eta).map_or(1.0, |reflectance| self.bsdf.specular * reflectance)
    }

    /// The diffuse base's part of the light along the mirrored direction.
    ///
    /// Lobes of about this much light are sampled about this often, so no sample's weight is far above 1.
    fn share_of_base(&self) -> f32 {
        let passed = if self.is_inside { 1.0 } else { 1.0 - self.layer(self.outgoing[2]) };
        let base = mean(self.bsdf.diffuse_color()) * passed;
        let facet = self.facet(self.outgoing[2]);
        let layer = mean(facet.reflected) + mean(facet.transmitted);
        // A black metal is not black on all its facets.
        if base > 0.0 { base / (base + layer) } else { 0.0 }
    }
}
