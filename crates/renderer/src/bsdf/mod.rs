//! The BSDF: the metallic-roughness model of glTF 2.0 with the extensions specular, transmission and ior.
//!
//! ```text
//! metal      GGX reflection, Schlick's Fresnel with base_color
//! dielectric GGX reflection, Fresnel of the ior times specular, on top of
//!            (1 - transmission) · Lambert + transmission · base_color · GGX refraction
//! material   metallic · metal + (1 - metallic) · dielectric
//! ```
//!
//! Directions are unit vectors in a local frame: +z is the shading normal on the side of `outgoing`, which points
//! towards the viewer. Light arrives from `incident`; its z is negative if the light is transmitted.
//!
//! # Departures from glTF
//!
//! * glTF attenuates the diffuse base by `1 - F(o·h)` with the half vector. At grazing angles a smooth coat then
//!   reflects all light while the base still reflects nearly as much as at normal incidence: almost 2 in total. Here
//!   the diffuse base has the factor `(1 - F(cosθo))·(1 - F(cosθi)) / (1 - F̄)` (Shirley et al. 1997), which is
//!   reciprocal and conserves energy.
//! * Dielectrics use the exact Fresnel equations instead of Schlick's approximation, so total internal reflection is
//!   correct.
//! * Seen from inside, the diffuse part of a partly transmissive boundary has no coat: `(1 - transmission)` Lambert and
//!   `transmission` glass. Total internal reflection would otherwise count the energy of the base twice.
//! * Microfacets lose the light that they scatter more than once: a rough white metal reflects a third of it. With
//!   [`Bsdf::is_compensated`] it is given back (see `energy`); without, the BSDF is that of single scattering.
//!
//! # Radiance
//!
//! The BSDF scatters radiance, from lights to the camera. Refraction scales radiance by `(no/ni)²`, the indices on the
//! sides of `outgoing` and `incident`. A path that enters glass carries `1/ior²` until it leaves; Russian roulette
//! should factor this out of the throughput ([`Bsdf::compression`]). Thin walls have the same medium on both sides.

mod boundary;
mod energy;
pub(crate) mod glass;
mod hair;
mod layers;
mod lobes;
mod microfacet;

use glam::Vec3;

use crate::Hemisphere;
use crate::sampling::cosine_density;
use boundary::{Boundary, Choice};
pub use hair::Hair;
use layers::Layers;
pub use lobes::Lobes;
use microfacet::{Ggx, fresnel};

/// A material at a hit, and the side from which the ray came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bsdf {
    /// Linear RGB in 0..=1: diffuse albedo, transmission tint, and reflectance of metals.
    pub base_color: [f32; 3],
    /// Metallic weight, 0..=1.
    pub metallic: f32,
    /// glTF roughness in 0..=1, the square root of GGX's `alpha`. Below 1/32 the boundary is a perfect mirror.
    pub roughness: f32,
    /// Strength of the dielectric reflection, 0..=1; 0 leaves only the base.
    pub specular: f32,
    /// Fraction of the base that transmits light, 0..=1.
    pub transmission: f32,
    /// Relative index of refraction, inside over outside, 1..=1000. glTF's 0 means full reflection: 1000.
    pub ior: f32,
    /// Whether the surface is a thin sheet with air on both sides, which does not refract.
    pub thin_walled: bool,
    /// Whether `outgoing` is inside the medium. Only transmissive, not thin-walled materials have an inside.
    pub is_inside: bool,
    /// Whether the light that rough boundaries lose by multiple scattering is given back.
    pub is_compensated: bool,
    /// How the diffuse lobe is sampled.
    pub hemisphere: Hemisphere,
    /// Further lobes; `None` for most materials.
    pub lobes: Option<Lobes>,
    /// The scattering of hair in place of all else.
    pub hair: Option<Hair>,
}

/// Value and PDF of the BSDF for two directions, without delta lobes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// The BSDF times the absolute cosine of `incident`.
    pub value: [f32; 3],
    /// PDF of `incident` in [`Bsdf::sample`], per steradian.
    pub density: f32,
}

/// A sampled incident direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit vector; z is negative if the light is transmitted.
    pub incident: [f32; 3],
    /// Factor of the incident radiance: BSDF times cosine over PDF, summed over all lobes.
    pub weight: [f32; 3],
    /// PDF per steradian, equal to that of [`Bsdf::evaluate`]; 0 if `is_delta`.
    pub density: f32,
    /// Whether the direction comes from a delta lobe: perfect reflection or transmission.
    pub is_delta: bool,
    /// Whether the light is transmitted. It then comes from the other medium unless the surface is thin-walled.
    pub is_transmitted: bool,
}

impl Bsdf {
    /// A diffuse surface with this albedo, linear RGB in 0..=1.
    #[must_use]
    pub fn lambert(base_color: [f32; 3]) -> Self {
        Self {
            base_color,
            metallic: 0.0,
            roughness: 1.0,
            specular: 0.0,
            transmission: 0.0,
            ior: 1.5,
            thin_walled: false,
            is_inside: false,
            is_compensated: false,
            hemisphere: Hemisphere::Cosine,
            lobes: None,
            hair: None,
        }
    }

    /// Evaluates the BSDF without delta lobes.
    ///
    /// Zero if `outgoing` is below the horizon, or either direction is at the horizon.
    #[must_use]
    pub fn evaluate(&self, outgoing: [f32; 3], incident: [f32; 3]) -> Evaluation {
        self.seen_from(outgoing).evaluate(incident)
    }

    /// Samples an incident direction, from a point of the unit square and a number in `[0, 1)` that chooses a lobe.
    ///
    /// `None` if no light is scattered: `outgoing` is not above the horizon, or the light is lost between microfacets.
    #[must_use]
    pub fn sample(&self, outgoing: [f32; 3], square: [f32; 2], choice: f32) -> Option<BsdfSample> {
        self.seen_from(outgoing).sample(square, choice)
    }

    /// The BSDF for one outgoing direction.
    #[must_use]
    pub(crate) fn seen_from(&self, outgoing: [f32; 3]) -> SeenBsdf<'_> {
        if outgoing[2] < MIN_COSINE {
            return SeenBsdf::Nothing;
        }
        if let Some(hair) = &self.hair {
            let turn = Turn(hair.direction);
            return SeenBsdf::Hair(hair, turn, turn.to(outgoing).into());
        }
        if self.is_lambert() {
            return SeenBsdf::Lambert(self);
        }
        let Some(lobes) = &self.lobes else {
            return SeenBsdf::Boundary(Boundary::new(self, None, outgoing.into()), Turn::NONE);
        };
        let turn = if lobes.anisotropy > 0.0 { Turn(lobes.direction) } else { Turn::NONE };
        let outgoing = turn.to(outgoing);
        // From inside a solid, layers are not seen.
        if !lobes.is_layered() || self.is_inside {
            return SeenBsdf::Boundary(Boundary::new(self, Some(lobes), outgoing), turn);
        }
        SeenBsdf::Layers(Box::new(Layers::new(self, lobes, outgoing)), turn)
    }

    /// Whether [`Self::evaluate`] is zero everywhere, so that light sampling is not needed.
    #[must_use]
    pub fn is_delta_only(&self) -> bool {
        if self.hair.is_some() {
            return false;
        }
        let is_smooth = |roughness| Ggx::of_roughness(roughness).is_none();
        let is_bare = self.lobes.is_none_or(|lobes| {
            lobes.sheen_color == [0.0; 3]
                && (lobes.clearcoat == 0.0 || is_smooth(lobes.clearcoat_roughness))
                && Ggx::stretched(self.roughness, lobes.anisotropy).is_none()
        });
        is_bare && is_smooth(self.roughness) && self.diffuse_color().iter().all(|&c| c == 0.0)
    }

    /// Albedo for a denoiser, seen from outside along the normal, linear RGB in 0..=1.
    ///
    /// White for clear glass and white mirrors, the tint of metals, diffuse albedo plus coat for others.
    #[must_use]
    pub fn albedo(&self) -> [f32; 3] {
        if let Some(lobes) = &self.lobes {
            let coat = (1.0 - self.metallic) * self.specular * Vec3::from(lobes.dielectric(1.0, self.ior));
            return (coat + (1.0 - coat) * Vec3::from(self.base_color)).into();
        }
        let coat = (1.0 - self.metallic) * self.specular * fresnel(1.0, self.ior).unwrap_or(1.0);
        self.base_color.map(|c| coat + (1.0 - coat) * c)
    }

    /// Scale of radiance that is transmitted towards `outgoing`; see the section Radiance of the module.
    #[must_use]
    pub fn compression(&self) -> f32 {
        match (self.thin_walled || self.hair.is_some(), self.is_inside) {
            (true, _) => 1.0,
            // From air into the denser medium, or the reverse.
            (false, false) => 1.0 / (self.ior * self.ior),
            (false, true) => self.ior * self.ior,
        }
    }

    /// Whether there is only the diffuse lobe, so that `choice` has no effect.
    pub(crate) fn is_lambert(&self) -> bool {
        self.metallic == 0.0
            && self.specular == 0.0
            && self.transmission == 0.0
            && self.lobes.is_none()
            && self.hair.is_none()
    }

    /// Albedo of the diffuse base without the coat.
    fn diffuse_color(&self) -> [f32; 3] {
        let share = (1.0 - self.metallic) * (1.0 - self.transmission);
        self.base_color.map(|c| c * share)
    }
}

/// Smaller cosines count as the horizon: quotients of larger ones never overflow.
const MIN_COSINE: f32 = f32::MIN_POSITIVE;

/// A [`Bsdf`] for one outgoing direction: what depends on that direction alone is computed once.
pub(crate) enum SeenBsdf<'a> {
    Nothing,
    Lambert(&'a Bsdf),
    Boundary(Boundary<'a>, Turn),
    Layers(Box<Layers<'a>>, Turn),
    /// With the outgoing direction in the frame of the hair.
    Hair(&'a Hair, Turn, [f32; 3]),
}

impl SeenBsdf<'_> {
    /// [`Bsdf::evaluate`].
    #[inline]
    pub(crate) fn evaluate(&self, incident: [f32; 3]) -> Evaluation {
        if incident[2].abs() < MIN_COSINE {
            return Evaluation::default();
        }
        match self {
            Self::Nothing => Evaluation::default(),
            Self::Lambert(bsdf) => {
                let lambert = cosine_density(incident[2]);
                let density = bsdf.hemisphere.density(incident[2]);
                Evaluation { value: bsdf.base_color.map(|c| c * lambert), density }
            }
            Self::Boundary(boundary, turn) => boundary.evaluate(turn.to(incident)),
            Self::Layers(layers, turn) => layers.evaluate(turn.to(incident)),
            Self::Hair(hair, turn, outgoing) => hair.evaluate(*outgoing, turn.to(incident).into()),
        }
    }

    /// [`Bsdf::sample`].
    #[inline]
    pub(crate) fn sample(&self, square: [f32; 2], choice: f32) -> Option<BsdfSample> {
        let (sample, turn) = match self {
            Self::Nothing => return None,
            Self::Lambert(Bsdf { hemisphere, base_color, .. }) => {
                let incident = hemisphere.direction(square);
                let density = hemisphere.density(incident[2]);
                let weight = base_color.map(|c| c * hemisphere.weight(incident[2]));
                return Some(BsdfSample { incident, weight, density, is_delta: false, is_transmitted: false });
            }
            Self::Boundary(boundary, turn) => (boundary.sampled(square, choice)?, turn),
            Self::Layers(layers, turn) => (layers.sampled(square, choice)?, turn),
            Self::Hair(hair, turn, outgoing) => (hair.sample(*outgoing, square, choice)?, turn),
        };
        Some(BsdfSample { incident: turn.back(sample.incident), ..sample })
    }
}

/// What scatters light from one direction.
trait Scatterer {
    fn evaluate(&self, incident: Vec3) -> Evaluation;

    fn sample(&self, square: [f32; 2], choice: f32) -> Option<Choice>;

    /// A sample with the weight of all lobes.
    fn sampled(&self, square: [f32; 2], choice: f32) -> Option<BsdfSample> {
        let incident = match self.sample(square, choice)? {
            Choice::Delta(sample) => return Some(sample),
            Choice::Direction(incident) => incident,
        };
        let Evaluation { value, density } = self.evaluate(incident);
        let is_transmitted = incident.z < 0.0;
        // Rounding may move a direction at the edge of a lobe out of it.
        (density > 0.0).then(|| {
            let weight = value.map(|x| x / density);
            BsdfSample { incident: incident.into(), weight, density, is_delta: false, is_transmitted }
        })
    }
}

/// A rotation about the normal, to a frame whose x axis is this unit vector.
#[derive(Clone, Copy)]
pub(crate) struct Turn([f32; 2]);

impl Turn {
    const NONE: Self = Self([1.0, 0.0]);

    fn to(self, [x, y, z]: [f32; 3]) -> Vec3 {
        let Self([c, s]) = self;
        Vec3::new(c * x + s * y, c * y - s * x, z)
    }

    fn back(self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let Self([c, s]) = self;
        [c * x - s * y, s * x + c * y, z]
    }
}
