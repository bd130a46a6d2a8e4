//! The environment as kernels read it.

use canted_gpu::{Bound, Buffer, Gpu, GpuError, Specialisation};
use canted_scene::{Environment, Scene};

use crate::environment_of;
use crate::light::packed::{SkyImage, bounded, sky_image};

/// A picture of all directions, on a device; nothing for light that is the same from everywhere.
pub(super) struct DeviceSky(Option<(Buffer<SkyImage>, Buffer<f32>)>);

impl DeviceSky {
    /// Uploads the environment of a scene.
    ///
    /// # Errors
    /// More texels than a binding of the device holds.
    pub(super) fn new(gpu: &Gpu, scene: &Scene) -> Result<Self, GpuError> {
        let Environment::Image(image) = environment_of(scene) else { return Ok(Self(None)) };
        let texels: Vec<f32> = image.texels.iter().flat_map(|texel| bounded(*texel)).collect();
        let texels = gpu.buffer("texels of the environment", &texels)?;
        Ok(Self(Some((gpu.uniform("environment", &sky_image(image))?, texels))))
    }

    /// What `shared/sky/image` binds.
    pub(super) fn bindings(&self) -> Vec<Bound<'_>> {
        let Some((image, texels)) = &self.0 else { return vec![] };
        vec![("sky_image", image), ("sky_texels", texels)]
    }

    /// Chooses the part that the scene needs.
    pub(super) fn specialise(&self, chosen: Specialisation) -> Specialisation {
        chosen.part("sky", if self.0.is_some() { "shared/sky/image" } else { "shared/sky/constant" })
    }
}
