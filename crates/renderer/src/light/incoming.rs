use std::f64::consts::PI;

use canted_film::srgb::luminance;
use canted_scene::Light;
use canted_trace::Ray;

use super::disk::DiskLight;
use super::sphere::SphereLight;
use crate::Surface;
use crate::vector::{Vector, dot, narrow, scale, sub, unit, wide};

/// Light from one direction at a surface, before the occlusion test. World space.
pub(crate) struct IncomingLight {
    /// Unit vector.
    pub(crate) to_light: Vector,
    /// Radiance over `density`. For a delta light, the irradiance on a surface that faces it.
    pub(crate) radiance: Vector,
    /// PDF of `to_light` per steradian; `None` for a delta light.
    pub(crate) density: Option<f64>,
    /// `None` if the light is too close for an occluder.
    pub(crate) shadow_ray: Option<Ray>,
}

impl IncomingLight {
    /// Samples a light of the scene file. Only lights with an area call `square`, for a point of the unit square.
    pub(crate) fn of(light: &Light, surface: &Surface, square: impl FnOnce() -> [f32; 2]) -> Option<Self> {
        match *light {
            Light::Sun { direction, irradiance } => {
                let to_light = direction.map(|d| -d);
                Some(Self {
                    to_light: wide(to_light),
                    radiance: wide(irradiance),
                    density: None,
                    shadow_ray: Some(surface.spawn_ray(to_light)),
                })
            }
            Light::Point { position, intensity } => Self::of_point(position, intensity, surface, |_| 1.0),
            Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
                let falloff =
                    |to_light| spot_falloff(-dot(wide(direction), to_light), cos_inner.into(), cos_outer.into());
                Self::of_point(position, intensity, surface, falloff)
            }
            Light::Sphere { center, radius, radiance } => {
                let (target, density) = SphereLight::new(center, radius).sample(surface.position, square())?;
                Self::of_target(surface, target, wide(radiance), density)
            }
            Light::Disk { center, normal, radius, radiance } => {
                let (target, density) = DiskLight::new(center, normal, radius).sample(surface.position, square())?;
                Self::of_target(surface, target, wide(radiance), density)
            }
        }
    }

    /// Light with an angular intensity distribution; `None` if the light is at the surface itself.
    fn of_point(
        position: [f32; 3],
        intensity: [f32; 3],
        surface: &Surface,
        falloff: impl FnOnce(Vector) -> f64,
    ) -> Option<Self> {
        let offset = sub(wide(position), surface.position);
        let to_light = unit(offset)?;
        let factor = falloff(to_light) / dot(offset, offset);
        (factor > 0.0).then(|| Self {
            to_light,
            radiance: scale(wide(intensity), factor),
            density: None,
            shadow_ray: surface.spawn_ray_to(position),
        })
    }

    /// Light from a point of a shape light, sampled with a PDF per steradian.
    fn of_target(surface: &Surface, target: Vector, radiance: Vector, density: f64) -> Option<Self> {
        Some(Self {
            to_light: unit(sub(target, surface.position))?,
            radiance: scale(radiance, 1.0 / density),
            density: Some(density),
            shadow_ray: surface.spawn_ray_to(narrow(target)),
        })
    }
}

/// Fraction of a spot light's intensity at an angle to its axis, see [`Light::Spot`].
fn spot_falloff(cosine: f64, cos_inner: f64, cos_outer: f64) -> f64 {
    if cosine >= cos_inner {
        1.0
    } else if cosine <= cos_outer {
        0.0
    } else {
        ((cosine - cos_outer) / (cos_inner - cos_outer)).powi(2)
    }
}

/// Maximum radiant intensity of a light with a position, in W/sr of luminance; `None` for a sun.
pub(super) fn intensity_of(light: &Light) -> Option<f64> {
    match *light {
        Light::Sun { .. } => None,
        Light::Point { intensity, .. } | Light::Spot { intensity, .. } => Some(luminance(wide(intensity))),
        Light::Sphere { radius, radiance, .. } | Light::Disk { radius, radiance, .. } => {
            Some(PI * f64::from(radius).powi(2) * luminance(wide(radiance)))
        }
    }
}

/// Power over maximum intensity, in steradians.
pub(super) fn effective_solid_angle(light: &Light) -> f64 {
    match *light {
        Light::Sun { .. } => 0.0,
        Light::Point { .. } | Light::Sphere { .. } => 4.0 * PI,
        // The mean cosine over a hemisphere is 1/2.
        Light::Disk { .. } => PI,
        Light::Spot { cos_inner, cos_outer, .. } => {
            let [inner, outer] = [cos_inner, cos_outer].map(f64::from);
            // The mean square of a linear ramp from 0 to 1 is 1/3.
            2.0 * PI * (1.0 - inner + (inner - outer) / 3.0)
        }
    }
}
