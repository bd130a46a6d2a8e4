use std::f64::consts::PI;

use glam::DVec3;

use crate::{Surface, wide};

#[cfg(feature = "gpu")]
use super::ListLight;
use super::tree::{Cluster, Cone};
use super::{IncomingLight, LightKind, LightShape, Place, luminance_of};

/// [`Light::Point`](canted_scene::Light::Point): a point that emits equally in all directions.
pub(super) struct Point {
    pub(super) position: [f32; 3],
    /// W/sr.
    pub(super) intensity: [f32; 3],
}

impl LightKind for Point {
    fn sample(&self, surface: &Surface, _: &mut dyn FnMut() -> [f32; 2]) -> Option<IncomingLight> {
        sample_point(self.position, self.intensity, surface, |_| 1.0)
    }

    fn place(&self) -> Place {
        let intensity = luminance_of(self.intensity);
        Place::Local(4.0 * PI * intensity, Cluster::of_box(self.position, DVec3::ZERO, Cone::ALL, intensity))
    }

    fn shape(&self) -> Option<&dyn LightShape> {
        None
    }

    #[cfg(feature = "gpu")]
    fn packed(&self) -> ListLight {
        ListLight { position: self.position, color: self.intensity, ..ListLight::default() }
    }
}

/// Light from a point, whose intensity has a factor by direction; `None` if the point is at the surface itself.
pub(super) fn sample_point(
    position: [f32; 3],
    intensity: [f32; 3],
    surface: &Surface,
    falloff: impl FnOnce(DVec3) -> f64,
) -> Option<IncomingLight> {
    let offset = wide(position) - DVec3::from(surface.position);
    let to_light = offset.try_normalize()?;
    let factor = falloff(to_light) / offset.dot(offset);
    (factor > 0.0).then(|| IncomingLight {
        to_light,
        radiance: wide(intensity) * factor,
        density: None,
        shadow_ray: surface.spawn_ray_to(position),
    })
}
