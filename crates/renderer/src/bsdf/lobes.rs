//! Further lobes of the BSDF: parameters at a hit.

use super::{fresnel, thin_film};

/// Further lobes, after the glTF extensions of [`canted_scene::Lobes`], at a hit.
///
/// ```text
/// sheen                fibers (Charlie)
/// clear coat           GGX reflection, ior 1.5
/// base                 the metallic-roughness model: anisotropic facets, a colored or iridescent reflection
/// ```
///
/// Each layer passes to the next what it does not reflect as a whole, by its albedo towards the viewer. So a white furnace stays
/// white for any base; the layers are not reciprocal, as the compensation of metals is not. Departures from glTF: the coat has the
/// shading normal of the base, and layers are seen from outside only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobes {
    /// Tint of the dielectric reflection at normal incidence.
    pub specular_color: [f32; 3],
    /// Strength of the clear coat, 0..=1.
    pub clearcoat: f32,
    /// Roughness of the coat, 0..=1.
    pub clearcoat_roughness: f32,
    /// Color of the fibers, 0..=1.
    pub sheen_color: [f32; 3],
    /// Roughness of the fibers, 0..=1.
    pub sheen_roughness: f32,
    /// Length of highlights along `direction`, 0..=1.
    pub anisotropy: f32,
    /// Unit vector in the plane of the surface, x and y of the local frame.
    pub direction: [f32; 2],
    /// Strength of the thin film, 0..=1.
    pub iridescence: f32,
    /// Index of refraction of the film.
    pub iridescence_ior: f32,
    /// Thickness of the film in nanometers.
    pub iridescence_thickness: f32,
    /// Absorption inside the solid, per unit of length.
    pub absorption: [f32; 3],
}

impl Default for Lobes {
    /// No further lobe.
    fn default() -> Self {
        Self {
            specular_color: [1.0; 3],
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            sheen_color: [0.0; 3],
            sheen_roughness: 0.0,
            anisotropy: 0.0,
            direction: [1.0, 0.0],
            iridescence: 0.0,
            iridescence_ior: 1.3,
            iridescence_thickness: 400.0,
            absorption: [0.0; 3],
        }
    }
}

impl Lobes {
    /// Whether there are layers over the base.
    pub(super) fn is_layered(&self) -> bool {
        self.clearcoat > 0.0 || self.sheen_color != [0.0; 3]
    }

    /// Whether the base reflects by an approximation of Fresnel's equations for a given reflectance at normal incidence.
    pub(super) fn is_colored(&self) -> bool {
        self.specular_color != [1.0; 3] || self.iridescence > 0.0
    }

    /// Reflectance of the dielectric base with this index of refraction, for `specular` 1.
    pub(super) fn dielectric(&self, cosine: f32, ior: f32) -> [f32; 3] {
        let normal = fresnel::dielectric(1.0, ior).unwrap_or(1.0);
        let normal = self.specular_color.map(|c| (c * normal).min(1.0));
        self.film(cosine, normal, normal.map(|f| fresnel::schlick(cosine, f)))
    }

    /// Reflectance of a base whose reflectance is `plain` without the film and `normal` at normal incidence.
    pub(super) fn film(&self, cosine: f32, normal: [f32; 3], plain: [f32; 3]) -> [f32; 3] {
        if self.iridescence == 0.0 {
            return plain;
        }
        let film = thin_film::reflectance(self.iridescence_ior, cosine, self.iridescence_thickness, normal);
        std::array::from_fn(|k| plain[k] + self.iridescence * (film[k] - plain[k]))
    }
}
