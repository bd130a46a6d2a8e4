//! The layered boundary for one outgoing direction: diffuse base, microfacets, and sampling probabilities.

use std::f32::consts::PI;

use glam::Vec3;

use super::energy::Energy;
use super::glass;
use super::lobes::Lobes;
use super::microfacet::{Ggx, fresnel, mean, mean_fresnel_below, reflect, refracted_cosine, schlick, unit};
use super::{Bsdf, BsdfSample, Evaluation, MIN_COSINE, Scatterer};
use crate::Hemisphere;

/// The minimum difference of `eta` from 1 at which a rough boundary refracts; below, light passes straight.
///
/// The half vector is then a sum of nearly opposite vectors. Its error of 2⁻²³ over this difference is 1/64 of the
/// width of the narrowest lobe.
const MIN_ETA_DIFFERENCE: f32 = 1.0 / 128.0;

/// What a boundary reads of a BSDF for every direction.
#[derive(Clone, Copy)]
struct Core {
    base_color: [f32; 3],
    diffuse: [f32; 3],
    metallic: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    thin_walled: bool,
    hemisphere: Hemisphere,
}

impl Core {
    fn of(bsdf: &Bsdf) -> Self {
        let &Bsdf { base_color, metallic, specular, transmission, ior, thin_walled, hemisphere, .. } = bsdf;
        let diffuse = bsdf.diffuse_color();
        Self { base_color, diffuse, metallic, specular, transmission, ior, thin_walled, hemisphere }
    }
}

/// A BSDF with a fixed outgoing direction.
pub(crate) struct Boundary<'a> {
    bsdf: Core,
    outgoing: Vec3,
    is_inside: bool,
    /// Index of refraction of the far side over that of the side of `outgoing`.
    eta: f32,
    /// `None` for a perfect mirror.
    facets: Option<Ggx>,
    /// Gives back light that the microfacets lose.
    energy: Option<Energy>,
    /// What a metal reflects is multiplied by 1 plus this times its base color.
    metal_gain: f32,
    /// Factor of what is transmitted.
    transmission_gain: f32,
    /// Factor of what the dielectric reflects.
    reflection_gain: f32,
    diffuse_probability: f32,
    /// Lobes that change the reflection, if any.
    lobes: Option<&'a Lobes>,
    /// Part of the light that the coat passes to the base on the way from `outgoing`.
    passed: f32,
    /// Mean of that part over the hemisphere.
    mean_passed: f32,
}

/// Reflection and transmission of a microfacet.
struct Facet {
    reflected: [f32; 3],
    transmitted: [f32; 3],
    /// Probability of sampling reflection; the rest is transmission.
    reflection_probability: f32,
}

/// A sampled direction. A delta lobe provides the complete sample.
pub(super) enum Choice {
    Direction(Vec3),
    Delta(BsdfSample),
}

impl Scatterer for Boundary<'_> {
    /// Evaluates all lobes; the z of `incident` is not 0.
    fn evaluate(&self, incident: Vec3) -> Evaluation {
        if incident.z > 0.0 { self.reflected(incident) } else { self.transmitted(incident) }
    }

    /// Samples a direction from one of the lobes; `None` if the light is lost between microfacets.
    fn sample(&self, square: [f32; 2], choice: f32) -> Option<Choice> {
        if choice < self.diffuse_probability {
            return Some(Choice::Direction(self.bsdf.hemisphere.direction(square).into()));
        }
        // Rescale the random number for the next choice.
        let choice = (choice - self.diffuse_probability) / (1.0 - self.diffuse_probability);
        let normal = self.facets.map_or(Vec3::Z, |facets| facets.sample(self.outgoing, square));
        let facet = self.facet(self.outgoing.dot(normal));
        if choice < facet.reflection_probability { self.reflect(&facet, normal) } else { self.transmit(&facet, normal) }
    }
}

impl<'a> Boundary<'a> {
    /// `lobes` are those of the BSDF.
    pub(super) fn new(bsdf: &Bsdf, lobes: Option<&'a Lobes>, outgoing: Vec3) -> Self {
        let is_inside = bsdf.is_inside && bsdf.transmission > 0.0 && !bsdf.thin_walled;
        let eta = if is_inside { 1.0 / bsdf.ior } else { bsdf.ior };
        let mut facets = Ggx::of_roughness(bsdf.roughness);
        let mut roughness = bsdf.roughness;
        if let Some(lobes) = lobes.filter(|lobes| lobes.anisotropy > 0.0) {
            facets = Ggx::stretched(bsdf.roughness, lobes.anisotropy);
            roughness = facets.map_or(roughness, |facets| facets.effective_roughness(outgoing));
        }
        let mut boundary = Self {
            bsdf: Core::of(bsdf),
            outgoing,
            is_inside,
            eta,
            facets,
            energy: (bsdf.is_compensated && facets.is_some()).then(|| Energy::new(roughness)),
            metal_gain: 0.0,
            transmission_gain: 1.0,
            reflection_gain: 1.0,
            diffuse_probability: 0.0,
            lobes: lobes.filter(|lobes| lobes.is_colored() && !is_inside),
            passed: 1.0,
            mean_passed: 1.0,
        };
        if let Some(energy) = boundary.energy {
            boundary.compensate(&energy, roughness);
        }
        if !is_inside && boundary.bsdf.diffuse != [0.0; 3] {
            boundary.passed = 1.0 - boundary.coat_albedo(outgoing.z);
            boundary.mean_passed = 1.0 - bsdf.specular * boundary.mean_reflectance();
        }
        boundary.diffuse_probability = boundary.base_probability();
        boundary
    }

    /// Sets the gains that give back what a rough boundary loses.
    fn compensate(&mut self, energy: &Energy, roughness: f32) {
        /// Smaller transmittances count as this.
        const MIN_PASSED: f32 = 1e-3;
        /// Smaller albedos of glass count as this.
        const MIN_ALBEDO: f32 = 0.1;
        let Core { metallic, thin_walled, transmission, ior, specular, .. } = self.bsdf;
        let cosine = self.outgoing.z;
        if transmission > 0.0 && !thin_walled && self.refracts() {
            let albedo = glass::albedo(cosine, roughness, ior, self.is_inside, specular);
            self.transmission_gain = 1.0 / albedo.max(MIN_ALBEDO);
            // From outside, only a part of the reflection belongs to glass: that over a diffuse base loses nothing.
            let of_glass = if self.is_inside { 1.0 } else { transmission };
            self.reflection_gain = 1.0 + of_glass * (self.transmission_gain - 1.0);
        }
        if metallic == 0.0 && !thin_walled && self.lobes.is_none() {
            return;
        }
        let albedo = match self.facets.filter(|facets| !facets.is_isotropic()) {
            Some(facets) => facets.albedo(self.outgoing).max(MIN_PASSED),
            None => energy.albedo(cosine),
        };
        self.metal_gain = (1.0 - albedo) / albedo;
        if thin_walled {
            // Facets mirror what a thin wall transmits, so that it loses as much as reflected light.
            let coat = self.coat(energy.effective_cosine(cosine));
            self.transmission_gain = (1.0 - albedo * coat) / (albedo * (1.0 - coat).max(MIN_PASSED));
        }
    }

    /// Light from the side of `outgoing`.
    fn reflected(&self, incident: Vec3) -> Evaluation {
        let lambert = incident.z / PI;
        let base = self.base(incident.z);
        let diffuse = Evaluation {
            value: base.map(|c| c * lambert),
            density: self.diffuse_probability * self.bsdf.hemisphere.density(incident.z),
        };
        let Some(facets) = self.facets else { return diffuse };
        let coat_reflectance = self.mirrored(facets, incident, |facet| (facet.reflected, facet.reflection_probability));
        Evaluation {
            value: (Vec3::from(diffuse.value) + Vec3::from(coat_reflectance.value)).into(),
            density: diffuse.density + coat_reflectance.density,
        }
    }

    /// Transmitted light.
    fn transmitted(&self, incident: Vec3) -> Evaluation {
        match self.facets {
            Some(facets) if self.bsdf.transmission > 0.0 => {
                let Vec3 { x, y, z } = incident;
                if self.bsdf.thin_walled {
                    self.mirrored(facets, Vec3::new(x, y, -z), |facet| {
                        (facet.transmitted, 1.0 - facet.reflection_probability)
                    })
                } else {
                    self.refracted(facets, incident)
                }
            }
            _ => Evaluation::default(),
        }
    }

    /// Microfacets that reflect `incident` into `outgoing`; `part` selects the facet's factor and probability.
    fn mirrored(&self, facets: Ggx, incident: Vec3, part: impl Fn(&Facet) -> ([f32; 3], f32)) -> Evaluation {
        let normal = unit(self.outgoing + incident);
        let (color, probability) = part(&self.facet(self.outgoing.dot(normal)));
        let area = facets.distribution(normal) * facets.masking(self.outgoing, incident);
        // The Jacobian is 1 over four times the cosine to the facet; the cosine cancels.
        let density = facets.density(self.outgoing, normal) / 4.0;
        Evaluation { value: color.map(|c| c * area), density: (1.0 - self.diffuse_probability) * probability * density }
    }

    /// Microfacets that refract `incident` into `outgoing`. Source: Walter et al. 2007, equations 16, 17 and 21.
    fn refracted(&self, facets: Ggx, incident: Vec3) -> Evaluation {
        if !self.refracts() {
            return Evaluation::default();
        }
        // The normal is along no + eta·ni, on the side of the thinner medium.
        let sum = unit(self.outgoing + self.eta * incident);
        let normal = if sum.z < 0.0 { -sum } else { sum };
        let (near, far) = (self.outgoing.dot(normal), incident.dot(normal));
        if near <= 0.0 || far >= 0.0 {
            return Evaluation::default();
        }
        let facet = self.facet(near);
        // The Jacobian of refraction; by Snell's law the absolute value of the sum is at least 1 - 1/eta.
        let jacobian = -far / (far + near / self.eta).powi(2);
        let masking = 4.0 * near * facets.masking(self.outgoing, -incident);
        let area = facets.distribution(normal) * masking * jacobian / (self.eta * self.eta);
        let density = near * facets.density(self.outgoing, normal) * jacobian;
        let probability = (1.0 - self.diffuse_probability) * (1.0 - facet.reflection_probability);
        Evaluation { value: facet.transmitted.map(|c| c * area), density: probability * density }
    }

    fn reflect(&self, facet: &Facet, normal: Vec3) -> Option<Choice> {
        if self.facets.is_none() {
            let Vec3 { x, y, z } = self.outgoing;
            return self.mirror(Vec3::new(-x, -y, z), facet.reflected, facet.reflection_probability);
        }
        let incident = reflect(self.outgoing, normal);
        (incident.z >= MIN_COSINE).then_some(Choice::Direction(incident))
    }

    fn transmit(&self, facet: &Facet, normal: Vec3) -> Option<Choice> {
        let probability = 1.0 - facet.reflection_probability;
        if self.bsdf.thin_walled {
            if self.facets.is_none() {
                return self.mirror(-self.outgoing, facet.transmitted, probability);
            }
            let Vec3 { x, y, z } = reflect(self.outgoing, normal);
            return (z >= MIN_COSINE).then_some(Choice::Direction(Vec3::new(x, y, -z)));
        }
        let color = facet.transmitted.map(|c| c / (self.eta * self.eta));
        if self.facets.is_some() && !self.refracts() {
            return self.mirror(-self.outgoing, color, probability);
        }
        let cosine = self.outgoing.dot(normal);
        let refracted = refracted_cosine(cosine, self.eta)?;
        // Snell's law divides the tangential part, and its error, by eta.
        let tangent = self.outgoing - cosine * normal;
        let incident = unit(-tangent / self.eta - refracted * normal);
        if self.facets.is_none() {
            return self.mirror(incident, color, probability);
        }
        (incident.z <= -MIN_COSINE).then_some(Choice::Direction(incident))
    }

    /// A sample of a delta lobe.
    fn mirror(&self, incident: Vec3, color: [f32; 3], probability: f32) -> Option<Choice> {
        let probability = probability * (1.0 - self.diffuse_probability);
        let weight = color.map(|c| c / probability);
        let is_transmitted = incident.z < 0.0;
        (probability > 0.0).then_some(Choice::Delta(BsdfSample {
            incident: incident.into(),
            weight,
            density: 0.0,
            is_delta: true,
            is_transmitted,
        }))
    }

    /// Whether a rough boundary refracts noticeably.
    fn refracts(&self) -> bool {
        (self.eta - 1.0).abs() >= MIN_ETA_DIFFERENCE
    }

    fn facet(&self, cosine: f32) -> Facet {
        let Core { base_color, metallic, transmission, .. } = self.bsdf;
        // Rounding may exceed the range slightly.
        let cosine = cosine.clamp(0.0, 1.0);
        let coat = self.coat(cosine);
        let reflected = match self.lobes {
            Some(lobes) => self.colored(lobes, cosine),
            None => {
                let of_side = if self.is_inside { transmission } else { 1.0 };
                let coat_reflectance = (1.0 - metallic) * coat * of_side * self.reflection_gain;
                if metallic == 0.0 {
                    [coat_reflectance; 3]
                } else {
                    let metal = |c| metallic * schlick(cosine, c) * (1.0 + c * self.metal_gain);
                    base_color.map(|c| metal(c) + coat_reflectance)
                }
            }
        };
        let through = (1.0 - metallic) * transmission * (1.0 - coat) * self.transmission_gain;
        let transmitted = base_color.map(|c| through * c);
        let (r, t) = (mean(reflected), mean(transmitted));
        Facet { reflected, transmitted, reflection_probability: if t > 0.0 { r / (r + t) } else { 1.0 } }
    }

    /// Reflectance of a facet with a colored or iridescent reflection.
    fn colored(&self, lobes: &Lobes, cosine: f32) -> [f32; 3] {
        let Core { base_color, metallic, .. } = self.bsdf;
        let gained = |c: f32| 1.0 + c * self.metal_gain;
        let metal = lobes.film(cosine, base_color, base_color.map(|c| schlick(cosine, c)));
        let coat = self.coat_colors(lobes, cosine);
        std::array::from_fn(|k| {
            metallic * metal[k] * gained(base_color[k]) + (1.0 - metallic) * coat[k] * gained(coat[k])
        })
    }

    /// Reflectance of a colored coat by channel, of smooth facets.
    fn coat_colors(&self, lobes: &Lobes, cosine: f32) -> [f32; 3] {
        lobes.dielectric(cosine, self.bsdf.ior).map(|c| self.bsdf.specular * c)
    }

    /// Albedo of the diffuse base below the coat, at an incident cosine; from inside there is no coat in front of it.
    fn base(&self, incident: f32) -> [f32; 3] {
        let color = self.bsdf.diffuse;
        if self.is_inside || color == [0.0; 3] {
            return color;
        }
        if self.lobes.is_some() {
            // There is no mean for any color: the base gets what the coat does not reflect to the viewer.
            return color.map(|c| c * self.passed);
        }
        let transmittance = self.passed * (1.0 - self.coat_albedo(incident));
        color.map(|c| c * transmittance / self.mean_passed)
    }

    /// Part of the light from a direction that the coat as a whole reflects.
    pub(super) fn coat_albedo(&self, cosine: f32) -> f32 {
        let Some(energy) = &self.energy else { return self.coat(cosine) };
        let [of_facets, effective] = energy.both(cosine);
        let coat = self.coat(effective);
        if self.lobes.is_some() {
            (of_facets * coat * (1.0 + coat * self.metal_gain)).min(1.0)
        } else {
            of_facets * coat
        }
    }

    /// Mean of the reflectance of the coat over the hemisphere, for `specular` 1.
    fn mean_reflectance(&self) -> f32 {
        self.energy.map_or_else(|| mean_fresnel_below(self.eta), |energy| energy.mean_coat(self.eta))
    }

    /// Reflectance of the dielectric coat, the largest of all channels. Total internal reflection does not depend on `specular`.
    fn coat(&self, cosine: f32) -> f32 {
        if let Some(lobes) = self.lobes {
            return self.coat_colors(lobes, cosine).into_iter().fold(0.0, f32::max);
        }
        fresnel(cosine, self.eta).map_or(1.0, |reflectance| self.bsdf.specular * reflectance)
    }

    /// Probability of sampling the diffuse base: its part of the energy at the mirrored direction.
    ///
    /// Lobes are sampled about in proportion to their energy, so that no sample has a weight far above 1.
    fn base_probability(&self) -> f32 {
        let color = mean(self.bsdf.diffuse);
        let base = color * self.passed;
        let facet = self.facet(self.outgoing.z);
        let coat = mean(facet.reflected) + mean(facet.transmitted);
        // A black metal still reflects at grazing angles.
        if base > 0.0 { base / (base + coat) } else { 0.0 }
    }
}
