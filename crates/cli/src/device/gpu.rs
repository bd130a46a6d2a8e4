//! GPUs, and the fallback to the CPU.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_gpu::{AdapterKind, Choice, DeviceBvh, Gpu, GpuError, TracedScene, block_on};
use canted_renderer::{DeviceError, SceneBvhConfig, built_scene};
use canted_scene::Scene;
use serde_json::{Value, json};

use super::DeviceArg;
use crate::{options::Structure, output, process};

/// An open compute device.
pub(crate) enum Machine {
    /// The CPU alone.
    Cpu,
    /// An adapter alone, requested explicitly.
    Device(Gpu),
    /// An adapter, or the CPU where the adapter does not support the request.
    Auto(Gpu),
    /// The CPU and an adapter together.
    Both(Gpu),
}

impl Machine {
    /// Opens a device. Warns about a software driver. Looks for no adapter where the CPU is the answer anyway: `auto` with
    /// a structure that GPUs do not support, or on a machine without a hardware GPU.
    ///
    /// # Errors
    /// There is no such adapter, or it provides no device.
    pub(crate) fn open(device: &DeviceArg, structure: &Structure) -> Result<Self> {
        Ok(match device {
            DeviceArg::Cpu => Self::Cpu,
            DeviceArg::Auto if structure.unsupported_on_gpu.is_some() || !may_have_hardware() => Self::Cpu,
            DeviceArg::Auto => match open_quietly(&Choice::Hardware) {
                Ok(gpu) => Self::Auto(gpu),
                Err(GpuError::NoAdapter { .. }) => Self::Cpu,
                Err(error) => {
                    warn_fallback(&error.into());
                    Self::Cpu
                }
            },
            DeviceArg::Gpu => Self::Device(open_adapter(&Choice::Best)?),
            DeviceArg::Named(name) => Self::Device(open_adapter(&Choice::Named(name.clone()))?),
            DeviceArg::Both(Some(name)) => Self::Both(open_adapter(&Choice::Named(name.clone()))?),
            DeviceArg::Both(None) => match open_quietly(&Choice::Hardware) {
                Ok(gpu) => Self::Both(gpu),
                Err(GpuError::NoAdapter { found, .. }) if !found.is_empty() => {
                    output::warn(&format!(
                        "using the CPU alone: '{}' is a software driver that runs on the same cores; use \
                         --device both:NAME to include it",
                        found[0]
                    ));
                    Self::Cpu
                }
                Err(error) => return Err(unopened(error)),
            },
        })
    }

    /// The adapter, if one is used.
    pub(crate) fn gpu(&self) -> Option<&Gpu> {
        match self {
            Self::Cpu => None,
            Self::Device(gpu) | Self::Auto(gpu) | Self::Both(gpu) => Some(gpu),
        }
    }

    /// Whether results come back over a bus, which takes time.
    pub(crate) fn has_bus(&self) -> bool {
        self.gpu().is_some_and(|gpu| gpu.info().kind != AdapterKind::Software)
    }

    /// Whether an adapter is to trace the rays. Where the CPU takes its place later, it has the small leaves of devices.
    pub(crate) fn traces_on_gpu(&self) -> bool {
        matches!(self, Self::Device(_) | Self::Auto(_))
    }

    /// What computes, where devices round differently.
    pub(crate) fn name(&self) -> String {
        let adapter = self.gpu().map(|gpu| gpu.info().name.clone()).unwrap_or_default();
        match self {
            Self::Cpu => "cpu".to_owned(),
            Self::Both(_) => format!("cpu and {adapter}"),
            Self::Device(_) | Self::Auto(_) => adapter,
        }
    }

    /// Whether an adapter is used.
    pub(crate) fn has_gpu(&self) -> bool {
        self.gpu().is_some()
    }

    /// Whether the CPU computes what the adapter does not support.
    fn falls_back(&self) -> bool {
        matches!(self, Self::Auto(_))
    }

    /// Runs `prepare` on the adapter. Returns `None` where the CPU computes instead.
    ///
    /// # Errors
    /// An adapter that was requested explicitly does not support the request, or the error is not the adapter's.
    pub(crate) fn ready<'a, T>(
        &'a self,
        structure: &Structure,
        prepare: impl FnOnce(&'a Gpu) -> Result<T, DeviceError>,
    ) -> Result<Option<(&'a Gpu, T)>> {
        let Some(gpu) = self.gpu() else { return Ok(None) };
        let error = match &structure.unsupported_on_gpu {
            Some(option) => anyhow!("{option} is not supported on the GPU; use --device cpu"),
            None => match prepare(gpu) {
                Ok(ready) => return Ok(Some((gpu, ready))),
                Err(DeviceError::Render(error)) => return Err(error.into()),
                // The CPU renders anyway.
                Err(error) if self.falls_back() => named(gpu, error),
                Err(error) => with_remedy(gpu, error),
            },
        };
        if !self.falls_back() {
            return Err(error);
        }
        warn_fallback(&error);
        Ok(None)
    }
}

/// The BVHs of a scene that a device builds, or those that `uploaded` returns where it does not support a wide build.
pub(crate) fn built_or(
    gpu: &Gpu,
    scene: &Scene,
    config: &SceneBvhConfig,
    bvh: DeviceBvh,
    uploaded: impl FnOnce() -> Result<TracedScene, DeviceError>,
) -> Result<TracedScene, DeviceError> {
    match built_scene(gpu, scene, config, bvh) {
        Err(DeviceError::Gpu(error)) if matches!(bvh, DeviceBvh::Wide(_)) && error.is_of_scene() => {
            let uploaded = uploaded()?;
            output::note(&format!("the CPU builds the BVHs: {error}"));
            Ok(uploaded)
        }
        built => built,
    }
}

/// Adds the name of the adapter to its errors.
pub(crate) fn named(gpu: &Gpu, error: DeviceError) -> anyhow::Error {
    match error {
        DeviceError::Render(error) => error.into(),
        DeviceError::Gpu(error) => anyhow!("{}: {error}", gpu.info().name),
        error => error.into(),
    }
}

/// [`named`], and the option that avoids the error.
fn with_remedy(gpu: &Gpu, error: DeviceError) -> anyhow::Error {
    let remedy = match &error {
        DeviceError::Gpu(GpuError::Limit { .. } | GpuError::OutOfMemory { .. }) => ", or use --device cpu",
        DeviceError::Gpu(GpuError::Unsupported { .. }) | DeviceError::Unsupported { .. } => "; use --device cpu",
        DeviceError::Raster { .. } => "; use --first-hit trace",
        _ => return named(gpu, error),
    };
    anyhow!("{}{remedy}", named(gpu, error))
}

/// Whether the system may have a hardware GPU. On Linux each driver of one has a device file, so that no driver is loaded
/// where there is none.
fn may_have_hardware() -> bool {
    const DEVICES: [&str; 6] =
        ["/dev/dri", "/dev/nvidiactl", "/dev/nvidia0", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0"];
    let is_named = || ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|name| std::env::var_os(name).is_some());
    !cfg!(target_os = "linux") || DEVICES.iter().any(|path| std::path::Path::new(path).exists()) || is_named()
}

fn open_quietly(choice: &Choice) -> Result<Gpu, GpuError> {
    let mut gpu = block_on(quietly(|| Gpu::open(choice)))?;
    if let Some(folder) = pipelines_folder() {
        gpu.keep_pipelines(&folder);
    }
    Ok(gpu)
}

/// Where compiled pipelines are kept: a folder among the user's caches.
fn pipelines_folder() -> Option<PathBuf> {
    use etcetera::BaseStrategy;
    let caches = etcetera::choose_base_strategy().ok()?.cache_dir();
    Some(caches.join("canted").join("pipelines"))
}

/// An error of opening an adapter, with the option that avoids it.
fn unopened(error: GpuError) -> anyhow::Error {
    match error {
        GpuError::NoAdapter { ref found, .. } if found.is_empty() => anyhow!("{error}, or use --device cpu"),
        error => error.into(),
    }
}

fn open_adapter(choice: &Choice) -> Result<Gpu> {
    let gpu = open_quietly(choice).map_err(unopened)?;
    let info = gpu.info();
    if info.kind == AdapterKind::Software {
        let name = &info.name;
        output::warn(&format!("'{name}' is a software driver: it runs on the CPU and is slower than --device cpu"));
        // A software driver shares the memory of the machine, and reports more than there is.
        if let Some(n_bytes) = process::available_bytes() {
            gpu.limit_memory(n_bytes);
        }
    }
    Ok(gpu)
}

fn warn_fallback(error: &anyhow::Error) {
    output::warn(&format!("falling back to the CPU: {error}"));
}

/// All adapters as JSON, preferred ones first.
pub(crate) fn adapters() -> Vec<Value> {
    let adapters = quietly(|| block_on(canted_gpu::adapters())).unwrap_or_default().into_iter().map(|info| {
        json!({
            "name": info.name, "kind": info.kind.to_string(), "backend": info.backend, "driver": info.driver,
            "is_software": info.kind == AdapterKind::Software, "max_binding_bytes": info.max_binding_bytes,
            "max_buffer_bytes": info.max_buffer_bytes, "has_timestamps": info.has_timestamps,
            "has_ray_queries": info.has_ray_queries,
        })
    });
    adapters.collect()
}

/// Messages of GPU drivers and of the Vulkan loader are kept off standard error: they complain about a missing desktop.
///
/// Runs `open` while standard error is discarded, unless `-v` is given.
#[cfg(unix)]
fn quietly<T>(open: impl FnOnce() -> T) -> T {
    use std::{
        fs::File,
        os::fd::{AsFd, OwnedFd},
    };

    /// Standard error as it was; restored on drop, also by a panic.
    struct Kept(OwnedFd);
    impl Drop for Kept {
        fn drop(&mut self) {
            let _ = rustix::stdio::dup2_stderr(&self.0);
        }
    }

    if crate::output::is_verbose() {
        return open();
    }
    let kept = std::io::stderr().as_fd().try_clone_to_owned();
    let (Ok(kept), Ok(nothing)) = (kept, File::options().write(true).open("/dev/null")) else { return open() };
    // Restored even if the call fails halfway.
    let _kept = Kept(kept);
    let _ = rustix::stdio::dup2_stderr(&nothing);
    open()
}

/// Runs `open`: loaders of other systems print nothing.
#[cfg(not(unix))]
fn quietly<T>(open: impl FnOnce() -> T) -> T {
    open()
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_fixtures::or_skip;

    /// What a device lacks is an error where the device was named, and the CPU's with `auto`.
    #[test]
    fn auto_takes_the_cpu_where_a_device_lacks_something() {
        let test = "auto_takes_the_cpu_where_a_device_lacks_something";
        let Some(gpu) = or_skip(test, block_on(Gpu::open(&Choice::Best))) else { return };
        let unsupported = Structure { unsupported_on_gpu: Some("--accel kdtree".to_owned()), ..Structure::default() };
        let lacks = |_: &Gpu| Err::<(), _>(DeviceError::Unsupported { what: "clear coats" });
        let machine = Machine::Device(gpu);
        let error = machine.ready(&Structure::default(), lacks).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("clear coats") && error.ends_with("; use --device cpu"), "{error}");
        let traced_only = |_: &Gpu| Err::<(), _>(DeviceError::Raster { what: "a lens" });
        let error = machine.ready(&Structure::default(), traced_only).map(|_| ()).unwrap_err().to_string();
        assert!(error.ends_with("; use --first-hit trace"), "{error}");
        assert!(machine.ready(&Structure::default(), |_| Ok(())).unwrap().is_some());
        let Machine::Device(gpu) = machine else { unreachable!() };
        let machine = Machine::Auto(gpu);
        assert!(machine.ready(&Structure::default(), lacks).unwrap().is_none());
        assert!(machine.ready(&unsupported, |_| Ok(())).unwrap().is_none());
        assert!(machine.ready(&Structure::default(), |_| Ok(())).unwrap().is_some());
    }
}
