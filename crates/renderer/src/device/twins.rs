//! What tests compare with kernels: lights on the CPU, and in the buffers of a device. Not part of the stable interface.

use canted_gpu::{AsBinding, Gpu, GpuError, NamedBinding, Variant};
use canted_scene::{Light, Scene};
use canted_trace::Ray;

use super::lights::{DeviceSky, SampledLights};
use crate::light::{IncomingLight, ListLight};
use crate::{LightSampler, Surface};

/// Light from one direction at a surface, before the occlusion test.
pub struct Incoming {
    /// Unit vector.
    pub to_light: [f64; 3],
    /// Radiance over `density`, or the irradiance of a delta light.
    pub radiance: [f64; 3],
    /// Per steradian; `None` for a delta light.
    pub density: Option<f64>,
    /// `None` if the light is too close for an occluder.
    pub shadow_ray: Option<Ray>,
}

/// The light of a point of the unit square at a surface.
#[must_use]
pub fn incoming_light(light: &Light, surface: &Surface, square: [f32; 2]) -> Option<Incoming> {
    let IncomingLight { to_light, radiance, density, shadow_ray } = IncomingLight::of(light, surface, || square)?;
    Some(Incoming { to_light: to_light.into(), radiance: radiance.into(), density, shadow_ray })
}

/// The albedos of rough glass that kernels read.
///
/// # Errors
/// Too little memory on the device.
pub fn glass_albedos(gpu: &Gpu) -> Result<impl AsBinding + use<>, GpuError> {
    gpu.buffer("albedos of glass", crate::bsdf::glass::table())
}

/// The buffer of a list of lights.
///
/// # Errors
/// Too little memory on the device.
pub fn light_list(gpu: &Gpu, lights: &[Light]) -> Result<impl AsBinding + use<>, GpuError> {
    gpu.buffer("lights", &lights.iter().map(ListLight::from).collect::<Vec<_>>())
}

/// The buffers that kernels sample lights from, without the list.
pub struct LightBuffers {
    sampled: SampledLights,
    sky: DeviceSky,
}

impl LightBuffers {
    /// Those of a sampler, with the environment of a scene and rays that start on surfaces.
    ///
    /// # Errors
    /// Too little memory on the device.
    pub fn new(gpu: &Gpu, sampler: &LightSampler<'_>, scene: &Scene) -> Result<Self, GpuError> {
        Ok(Self { sampled: SampledLights::new(gpu, sampler, |_| 0.0)?, sky: DeviceSky::new(gpu, scene)? })
    }

    /// All of them, by the names of their variables.
    #[must_use]
    pub fn bindings(&self) -> Vec<NamedBinding<'_>> {
        self.sampled.bindings().into_iter().chain(self.sky.bindings()).collect()
    }

    /// Selects the parts of kernels that the lights need.
    #[must_use]
    pub fn specialize(&self, chosen: Variant) -> Variant {
        self.sky.specialize(self.sampled.specialize(chosen))
    }
}

#[cfg(test)]
mod tests {
    use canted_shaders::{Shader, same_layout};

    use canted_gpu::{choice, wgsl};

    use super::super::streams::STATE_WORDS;
    use super::*;
    use crate::light::environment::SkyImage;
    use crate::light::tree::LightNode;
    use crate::light::triangle::PackedEmitter;

    #[test]
    fn layouts_match_the_kernels() {
        let listed = Variant::none();
        same_layout!(
            wgsl::check::INCOMING,
            &listed,
            "ListLight",
            ListLight { position, kind, direction, extent, color, cos_outer }
        );
        let sampled = Variant::none()
            .with(choice::Local::Both)
            .with(choice::Skylight::Image)
            .with(choice::Suns::List)
            .with(choice::Emission::Constant)
            .with(choice::Sky::Image);
        same_layout!(
            wgsl::check::LIGHT,
            &sampled,
            "LightNode",
            LightNode {
                center,
                radius,
                axis,
                cos_emission,
                spread,
                intensity,
                is_two_sided,
                parent,
                first_child,
                light
            }
        );
        same_layout!(
            wgsl::check::LIGHT,
            &sampled,
            "Emitter",
            PackedEmitter { corner, instance, first, primitive, second, leaf, radiance, slack }
        );
        same_layout!(wgsl::check::LIGHT, &sampled, "SkyImage", SkyImage { scale, width, height, turn });
    }

    #[test]
    fn states_of_streams_have_the_size_of_their_buffer() {
        let size_of_state = |integrator: choice::Integrator, name: &str| {
            let all = canted_shaders::variants(wgsl::render::stream::SHADE).unwrap();
            let chosen = all.into_iter().find(|chosen| chosen.has(integrator)).unwrap();
            Shader::new(wgsl::render::stream::SHADE, &chosen).unwrap().layout(name).unwrap().size as usize
        };
        let path = size_of_state(choice::Integrator::Path, "Path");
        let gathering = size_of_state(choice::Integrator::Hybrid, "Gathering");
        assert_eq!(path.max(gathering), 4 * STATE_WORDS);
    }
}
