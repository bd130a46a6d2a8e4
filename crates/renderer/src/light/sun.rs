use crate::{Surface, wide};

#[cfg(feature = "gpu")]
use super::ListLight;
use super::{IncomingLight, LightKind, LightShape, Place, luminance_of};

/// [`Light::Sun`](canted_scene::Light::Sun): light from one direction, infinitely far away.
pub(super) struct Sun {
    /// Unit direction of propagation.
    pub(super) direction: [f32; 3],
    /// W/m² on a surface that faces it.
    pub(super) irradiance: [f32; 3],
}

impl LightKind for Sun {
    fn sample(&self, surface: &Surface, _: &mut dyn FnMut() -> [f32; 2]) -> Option<IncomingLight> {
        let to_light = self.direction.map(|d| -d);
        Some(IncomingLight {
            to_light: wide(to_light),
            radiance: wide(self.irradiance),
            density: None,
            shadow_ray: Some(surface.spawn_ray(to_light)),
        })
    }

    fn place(&self) -> Place {
        Place::Infinite(luminance_of(self.irradiance))
    }

    fn shape(&self) -> Option<&dyn LightShape> {
        None
    }

    #[cfg(feature = "gpu")]
    fn packed(&self) -> ListLight {
        ListLight { direction: self.direction, color: self.irradiance, ..ListLight::default() }
    }
}
