//! How a surface scatters light: the metallic-roughness model of glTF 2.0 with its extensions specular, transmission
//! and ior.
//!
//! ```text
//! metal      GGX reflection, Fresnel after Schlick from base_color
//! otherwise  a layer of GGX reflection, Fresnel of the ior times specular
//!            over (1 - transmission) · Lambert + transmission · base_color · GGX refraction
//! material   metallic · metal + (1 - metallic) · otherwise
//! ```
//!
//! Directions are unit vectors in a local frame: +z is the shading normal on the side of `outgoing`, which points
//! towards the viewer; light arrives from `incident`, through the surface where its z is below 0.
//!
//! # Departures from glTF
//!
//! * Its layer takes `F(o·h)` from the base, with the half vector even of the diffuse base: a smooth layer reflects all
//!   light at the horizon and the base below still nearly as much as at noon, almost 2 in sum. Here the diffuse base
//!   has the factor `(1 - F(cosθo))·(1 - F(cosθi)) / (1 - F̄)` (Shirley et al. 1997), reciprocal and in sum at most 1.
//! * Fresnel's equations stand in place of Schlick's approximation for what is no metal, so total reflection is right.
//!
//! * Seen from inside, the diffuse part of a boundary that partly transmits has no layer before it: `(1 - transmission)`
//!   Lambert and `transmission` glass. Total reflection would add to the base what the base already gives.
//!
//! Light scattered more than once between facets is lost, as in glTF: a rough white metal is darker than 1.
//!
//! # Radiance
//!
//! What is scattered is radiance on its way to a camera. Through a boundary it changes by `(no/ni)²`, the indices on the
//! sides of `outgoing` and `incident`, as the same light fills a narrower cone in the denser medium. A path that enters
//! glass carries `1/ior²` until it leaves; whoever ends paths by their throughput should take that factor out. Thin
//! walls have the same medium on both sides.

mod boundary;
mod fresnel;
mod ggx;
mod vector;

use boundary::{Boundary, Choice};

use crate::sampling::{cosine_density, cosine_hemisphere};

/// The material at a hit and the side from which a ray arrived; plain numbers, the same on every device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bsdf {
    /// Linear RGB in 0..=1: albedo of the diffuse base, tint of what is transmitted, reflectance of metals.
    pub base_color: [f32; 3],
    /// Share of metal, 0..=1.
    pub metallic: f32,
    /// glTF's roughness in 0..=1, the root of GGX's `alpha`. Below 1/32 the boundary is a mirror.
    pub roughness: f32,
    /// Strength of the reflection of what is no metal, 0..=1; 0 leaves the pure base.
    pub specular: f32,
    /// Share of the base that lets light through, 0..=1.
    pub transmission: f32,
    /// Index of refraction of the inside over that of the outside, 1..=1000. glTF's 0 means full reflection: 1000.
    pub ior: f32,
    /// Whether the surface is a sheet with air on both sides; light passes it without being bent.
    pub thin_walled: bool,
    /// Whether `outgoing` lies inside the medium. Only what transmits and is not thin has an inside.
    pub is_inside: bool,
}

/// What all lobes but the mirrors scatter from one direction into another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// The scattering function times the absolute cosine of `incident`.
    pub value: [f32; 3],
    /// Density with which [`Bsdf::sample`] finds `incident`, per steradian.
    pub density: f32,
}

/// A direction that light may arrive from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit vector; z below 0 where the light comes through.
    pub incident: [f32; 3],
    /// What the radiance from there is multiplied with: value over density, of all lobes that share the direction.
    pub weight: [f32; 3],
    /// Density per steradian, as [`Bsdf::evaluate`] gives it; 0 where `is_delta`, for no other technique finds it.
    pub density: f32,
    /// Whether a mirror or a clear boundary made the direction.
    pub is_delta: bool,
    /// Whether the light comes through; it then comes from the other medium unless the surface is thin.
    pub is_transmitted: bool,
}

impl Bsdf {
    /// A diffuse surface of this albedo, linear RGB in 0..=1.
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
        }
    }

    /// Scattering from `incident` into `outgoing`, mirrors and clear boundaries left out.
    ///
    /// Nothing where `outgoing` is below the horizon or either direction lies in it.
    #[must_use]
    pub fn evaluate(&self, outgoing: [f32; 3], incident: [f32; 3]) -> Evaluation {
        if outgoing[2] < MIN_COSINE || incident[2].abs() < MIN_COSINE {
            return Evaluation::default();
        }
        if self.is_lambert() {
            let density = cosine_density(incident[2]);
            return Evaluation { value: self.base_color.map(|c| c * density), density };
        }
        Boundary::new(self, outgoing).evaluate(incident)
    }

    /// A direction to look for light in, from a point of the unit square and a number in `[0, 1)` that chooses a lobe.
    ///
    /// `None` where nothing arrives: `outgoing` is not above the horizon, or light was lost between facets.
    #[must_use]
    pub fn sample(&self, outgoing: [f32; 3], square: [f32; 2], choice: f32) -> Option<BsdfSample> {
        if outgoing[2] < MIN_COSINE {
            return None;
        }
        if self.is_lambert() {
            let incident = cosine_hemisphere(square);
            let density = cosine_density(incident[2]);
            let weight = self.base_color;
            return Some(BsdfSample { incident, weight, density, is_delta: false, is_transmitted: false });
        }
        let boundary = Boundary::new(self, outgoing);
        let incident = match boundary.sample(square, choice)? {
            Choice::Mirrored(scattered) => return Some(scattered),
            Choice::Direction(incident) => incident,
        };
        let Evaluation { value, density } = boundary.evaluate(incident);
        let is_transmitted = incident[2] < 0.0;
        // Rounding may take a direction at the edge of a lobe out of it.
        (density > 0.0).then(|| {
            let weight = value.map(|x| x / density);
            BsdfSample { incident, weight, density, is_delta: false, is_transmitted }
        })
    }

    /// Whether [`Self::evaluate`] is zero everywhere, so that lights need not be sampled.
    #[must_use]
    pub fn is_delta_only(&self) -> bool {
        let is_smooth = ggx::Ggx::of_roughness(self.roughness).is_none();
        is_smooth && self.diffuse_color().iter().all(|&c| c == 0.0)
    }

    /// Colour for a denoiser, seen from outside along the normal: what white light becomes, linear RGB in 0..=1.
    ///
    /// White for clear glass and white mirrors, the tint of metals, albedo and gloss of the rest.
    #[must_use]
    pub fn albedo(&self) -> [f32; 3] {
        let gloss = (1.0 - self.metallic) * self.specular * fresnel::dielectric(1.0, self.ior).unwrap_or(1.0);
        self.base_color.map(|c| gloss + (1.0 - gloss) * c)
    }

    /// Factor of radiance on its way out through the boundary, towards `outgoing`; see the module's last section.
    #[must_use]
    pub fn compression(&self) -> f32 {
        match (self.thin_walled, self.is_inside) {
            (true, _) => 1.0,
            // From the denser medium into air, or the other way about.
            (false, false) => 1.0 / (self.ior * self.ior),
            (false, true) => self.ior * self.ior,
        }
    }

    /// Whether all is scattered by one lobe, so that the number that chooses one does not matter.
    pub(crate) fn is_lambert(&self) -> bool {
        self.metallic == 0.0 && self.specular == 0.0 && self.transmission == 0.0
    }

    /// Albedo of the diffuse base before the layer takes its share.
    fn diffuse_color(&self) -> [f32; 3] {
        let share = (1.0 - self.metallic) * (1.0 - self.transmission);
        self.base_color.map(|c| c * share)
    }
}

/// Cosines below it count as the horizon: the quotient of two that are not never overflows.
const MIN_COSINE: f32 = f32::MIN_POSITIVE;
