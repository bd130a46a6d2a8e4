//! Packs the environment.

use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding, Variant};
use canted_scene::{Environment, Scene};

use crate::environment_of;
use crate::light::packed::{SkyImage, bounded, sky_image};

/// The environment on the GPU.
pub(super) enum DeviceSky {
    /// No light.
    Black,
    /// Constant radiance, stored with the picture.
    Constant,
    /// An image and its texels.
    Image(Buffer<SkyImage>, Buffer<f32>),
}

impl DeviceSky {
    /// Uploads the environment of a scene.
    ///
    /// # Errors
    /// More texels than a binding holds.
    pub(super) fn new(gpu: &Gpu, scene: &Scene) -> Result<Self, GpuError> {
        let image = match environment_of(scene) {
            Environment::Image(image) => image,
            Environment::Constant(radiance) if bounded(*radiance) == [0.0; 3] => return Ok(Self::Black),
            Environment::Constant(_) => return Ok(Self::Constant),
        };
        let texels: Vec<f32> = image.texels.iter().flat_map(|texel| bounded(*texel)).collect();
        let texels = gpu.read_only("texels of the environment", &texels)?;
        Ok(Self::Image(gpu.read_only_uniform("environment", &sky_image(image))?, texels))
    }

    /// The bindings of the part.
    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        match self {
            Self::Black | Self::Constant => vec![],
            Self::Image(image, texels) => vec![("sky_image", image), ("sky_texels", texels)],
        }
    }

    /// Selects the part that the scene needs.
    pub(super) fn specialize(&self, chosen: Variant) -> Variant {
        chosen.part(
            "sky",
            match self {
                Self::Black => "shared/sky/black",
                Self::Constant => "shared/sky/constant",
                Self::Image(..) => "shared/sky/image",
            },
        )
    }
}
