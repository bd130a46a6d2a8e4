use std::f64::consts::PI;

use canted_film::srgb::luminance;
use canted_scene::Light;
use canted_trace::Ray;

use super::disk::DiskLight;
use super::sphere::SphereLight;
use crate::Surface;
use crate::vector::{Vector, dot, narrow, scale, sub, unit, wide};

/// Light on its way to a surface, if nothing stands between. World space.
pub(crate) struct IncomingLight {
    /// Unit vector.
    pub(crate) to_light: Vector,
    /// Radiance over `density`; of a light without extent, the irradiance on what faces it.
    pub(crate) radiance: Vector,
    /// Density with which `to_light` was found, per steradian; `None` for a light without extent.
    pub(crate) density: Option<f64>,
    /// `None` where the light is too close for anything to stand between.
    pub(crate) shadow_ray: Option<Ray>,
}

impl IncomingLight {
    /// What comes from a light of the list; `square` gives a point of the unit square and is asked only by lights
    /// that have an extent.
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
                let share = |to_light| spot_share(-dot(wide(direction), to_light), cos_inner.into(), cos_outer.into());
                Self::of_point(position, intensity, surface, share)
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

    /// Light of an intensity that depends on the direction; none from a point at the surface itself.
    fn of_point(
        position: [f32; 3],
        intensity: [f32; 3],
        surface: &Surface,
        share: impl FnOnce(Vector) -> f64,
    ) -> Option<Self> {
        let way = sub(wide(position), surface.position);
        let to_light = unit(way)?;
        let factor = share(to_light) / dot(way, way);
        (factor > 0.0).then(|| Self {
            to_light,
            radiance: scale(wide(intensity), factor),
            density: None,
            shadow_ray: surface.spawn_ray_to(position),
        })
    }

    /// Light from a point of a body, found with a density per steradian.
    fn of_target(surface: &Surface, target: Vector, radiance: Vector, density: f64) -> Option<Self> {
        Some(Self {
            to_light: unit(sub(target, surface.position))?,
            radiance: scale(radiance, 1.0 / density),
            density: Some(density),
            shadow_ray: surface.spawn_ray_to(narrow(target)),
        })
    }
}

/// Share of a spot's intensity at a cosine to its axis, as [`Light::Spot`] says; a cone without a soft edge is cut.
fn spot_share(cosine: f64, cos_inner: f64, cos_outer: f64) -> f64 {
    if cosine >= cos_inner {
        1.0
    } else if cosine <= cos_outer {
        0.0
    } else {
        ((cosine - cos_outer) / (cos_inner - cos_outer)).powi(2)
    }
}

/// Greatest radiant intensity of a light that has a place, in W/sr by luminance; `None` for a sun.
pub(super) fn intensity_of(light: &Light) -> Option<f64> {
    match *light {
        Light::Sun { .. } => None,
        Light::Point { intensity, .. } | Light::Spot { intensity, .. } => Some(luminance(wide(intensity))),
        Light::Sphere { radius, radiance, .. } | Light::Disk { radius, radiance, .. } => {
            Some(PI * f64::from(radius).powi(2) * luminance(wide(radiance)))
        }
    }
}

/// Solid angle into which a light would send its power if its intensity were the greatest everywhere there.
pub(super) fn spread_of(light: &Light) -> f64 {
    match *light {
        Light::Sun { .. } => 0.0,
        Light::Point { .. } | Light::Sphere { .. } => 4.0 * PI,
        // The mean of the cosine over a hemisphere is a half.
        Light::Disk { .. } => PI,
        Light::Spot { cos_inner, cos_outer, .. } => {
            let [inner, outer] = [cos_inner, cos_outer].map(f64::from);
            // The mean of a square that rises from 0 to 1 in a straight line is a third.
            2.0 * PI * (1.0 - inner + (inner - outer) / 3.0)
        }
    }
}
