//! The device of a session: the CPU, or a GPU that renders what it supports.

use anyhow::{Result, anyhow};

use crate::{device::DeviceArg, render::Args};

#[cfg(not(feature = "gpu"))]
pub(super) use on_cpu::Device;
#[cfg(feature = "gpu")]
pub(super) use on_gpu::Device;

/// Rejects a device that a session cannot have.
pub(super) fn check(args: &Args) -> Result<()> {
    match args.device() {
        DeviceArg::Both(_) => Err(anyhow!("--device both requires `canted render`; use cpu, gpu or an adapter name")),
        _ => Ok(()),
    }
}

#[cfg(feature = "gpu")]
mod on_gpu {
    use std::sync::atomic::AtomicBool;

    use anyhow::{Error, Result, anyhow};
    use canted_film::Film;
    use canted_gpu::Gpu;
    use canted_renderer::{DeviceError, DevicePicture, FirstHit, Monitor, Settings, Structure, traced_scene};
    use canted_scene::Scene;
    use canted_wide::LaneKernel;

    use super::super::traced::{Passes, Shot};
    use crate::{
        device::{DeviceArg, Machine, built_or, named},
        output,
        render::Args,
    };

    /// The device of the options, open while they name it.
    #[derive(Default)]
    pub(in super::super) struct Device(Option<(DeviceArg, Machine)>);

    impl Device {
        /// Opens the device of the options, if it is not open. Warns where the CPU is used in its place.
        pub(in super::super) fn choose(&mut self, args: &Args) {
            let wanted = args.device();
            if self.0.as_ref().is_some_and(|(open, _)| open == wanted) {
                return;
            }
            let machine = Machine::open(wanted, &args.structure).unwrap_or_else(|error| {
                warn_fallback(&error);
                Machine::Cpu
            });
            self.0 = Some((wanted.clone(), machine));
        }

        /// Opens the device again with the next job: it may have been lost.
        pub(in super::super) fn reset(&mut self) {
            self.0 = None;
        }

        /// The picture on the GPU; `None` where the CPU renders, with a warning if the GPU does not support the picture.
        pub(in super::super) fn picture<'a, K: LaneKernel>(
            &'a self,
            shot: &'a Shot<'a>,
            structure: &'a Structure<K>,
        ) -> Result<Option<OnGpu<'a, K>>> {
            let Some((wanted, machine)) = &self.0 else { return Ok(None) };
            let Some(gpu) = machine.gpu() else { return Ok(None) };
            let Shot { surfaces, camera, args, settings } = *shot;
            if let Some(option) = args.structure.unsupported_on_gpu() {
                warn_fallback(&anyhow!("{option} is not supported on the GPU"));
                return Ok(None);
            }
            let first_hit = if args.first_hit() == FirstHit::Raster { FirstHit::Raster } else { FirstHit::Trace };
            let picture = match args.structure.built_on_gpu() {
                Some(bvh) => {
                    let config = args.structure.config_quietly()?;
                    let make =
                        |scene: &Scene| built_or(gpu, scene, &config, bvh, || traced_scene(gpu, scene, structure));
                    DevicePicture::over(gpu, surfaces, structure, camera, settings, make)
                }
                None => DevicePicture::new(gpu, surfaces, structure, camera, settings),
            };
            match picture.and_then(|picture| picture.with_first_hit(first_hit)) {
                Ok((picture, _)) => Ok(Some(OnGpu { gpu, name: name_of(wanted), picture })),
                Err(DeviceError::Render(error)) => Err(error.into()),
                Err(error) => {
                    warn_fallback(&named(gpu, error));
                    Ok(None)
                }
            }
        }
    }

    fn warn_fallback(error: &Error) {
        output::warn(&format!("the CPU renders: {error}"));
    }

    /// The value of `--device`.
    fn name_of(device: &DeviceArg) -> String {
        match device {
            DeviceArg::Named(name) => name.clone(),
            _ => "gpu".to_owned(),
        }
    }

    /// Renders on a GPU.
    pub(in super::super) struct OnGpu<'a, K: LaneKernel> {
        gpu: &'a Gpu,
        name: String,
        picture: DevicePicture<'a, K>,
    }

    impl<K: LaneKernel> Passes for OnGpu<'_, K> {
        fn device(&self) -> &str {
            &self.name
        }

        fn film(&self, settings: &Settings, cancel: &AtomicBool) -> Result<Film> {
            let monitor = Monitor { progress: &|_, _| {}, finished: &|_| {}, cancel };
            self.picture.render_part(settings.part, &monitor).map_err(|error| named(self.gpu, error))
        }
    }
}

#[cfg(not(feature = "gpu"))]
mod on_cpu {
    use crate::{
        device::{DeviceArg, Machine},
        output,
        render::Args,
    };

    /// The CPU.
    #[derive(Default)]
    pub(in super::super) struct Device(Option<DeviceArg>);

    impl Device {
        /// Warns where the options name another device.
        pub(in super::super) fn choose(&mut self, args: &Args) {
            if self.0.as_ref() != Some(args.device())
                && let Err(error) = Machine::open(args.device(), &args.structure)
            {
                output::warn(&format!("the CPU renders: {error}"));
            }
            self.0 = Some(args.device().clone());
        }

        /// There is nothing to open again.
        pub(in super::super) fn reset(&mut self) {}
    }
}
