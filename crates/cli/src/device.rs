//! How a command runs: on which device, with how many threads.

use std::str::FromStr;

use anyhow::{Result, anyhow};
use canted_gpu::{AdapterKind, Choice, Gpu, GpuError};
use canted_renderer::DeviceError;

use crate::{
    memory,
    options::{self, TriangleTest},
    output,
};

/// The value of `--device`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum DeviceArg {
    /// A hardware GPU if there is one and it supports the request, else the CPU.
    Auto,
    Cpu,
    /// The best adapter, software drivers included.
    Gpu,
    /// The CPU together with an adapter: the best hardware adapter, or the one of this name.
    Both(Option<String>),
    /// The best adapter whose name contains this text.
    Named(String),
}

impl FromStr for DeviceArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "auto" => Self::Auto,
            "cpu" => Self::Cpu,
            "gpu" => Self::Gpu,
            "both" => Self::Both(None),
            _ => match text.strip_prefix("both:").unwrap_or(text).trim() {
                "" => return Err("expected auto, cpu, gpu, both or part of an adapter name".to_owned()),
                name if text.starts_with("both:") => Self::Both(Some(name.to_owned())),
                name => Self::Named(name.to_owned()),
            },
        })
    }
}

/// The options about how a command runs.
#[derive(clap::Args, Clone)]
pub(crate) struct RunArgs {
    /// Compute device: auto, cpu, gpu, or part of an adapter name (see `canted devices`). `auto` uses a hardware GPU that
    /// supports the scene, else the CPU.
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    pub(crate) device: DeviceArg,
    /// Number of CPU threads [default: all]
    #[arg(long, value_parser = options::threads, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Print the report as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

impl RunArgs {
    /// Starts the threads and opens the device of a command that cannot share its work between CPU and GPU.
    pub(crate) fn start(&self) -> Result<Machine> {
        options::use_threads(self.threads)?;
        if matches!(self.device, DeviceArg::Both(_)) {
            return Err(anyhow!("--device both requires `canted render`; use cpu, gpu or an adapter name"));
        }
        self.device.open()
    }
}

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

impl DeviceArg {
    /// Opens the device. Warns about a software driver.
    ///
    /// # Errors
    /// There is no such adapter, or it provides no device.
    pub(crate) fn open(&self) -> Result<Machine> {
        Ok(match self {
            Self::Cpu => Machine::Cpu,
            Self::Auto => match Gpu::open(&Choice::Hardware) {
                Ok(gpu) => Machine::Auto(gpu),
                Err(GpuError::NoAdapter { .. }) => Machine::Cpu,
                Err(error) => {
                    warn_fallback(&error);
                    Machine::Cpu
                }
            },
            Self::Gpu => Machine::Device(open_adapter(&Choice::Best)?),
            Self::Named(name) => Machine::Device(open_adapter(&Choice::Named(name.clone()))?),
            Self::Both(Some(name)) => Machine::Both(open_adapter(&Choice::Named(name.clone()))?),
            Self::Both(None) => match Gpu::open(&Choice::Hardware) {
                Ok(gpu) => Machine::Both(gpu),
                Err(GpuError::NoAdapter { found, .. }) if !found.is_empty() => {
                    let name = &found[0];
                    output::warn(&format!(
                        "using the CPU alone: '{name}' is a software driver that runs on the same cores; use \
                         --device both:NAME to include it"
                    ));
                    Machine::Cpu
                }
                Err(error) => return Err(error.into()),
            },
        })
    }
}

fn open_adapter(choice: &Choice) -> Result<Gpu> {
    let gpu = Gpu::open(choice)?;
    let facts = gpu.info();
    if facts.kind == AdapterKind::Software {
        output::warn(&format!(
            "'{}' is a software driver: it runs on the CPU and is slower than --device cpu",
            facts.name
        ));
        // A software driver shares the memory of the machine, and reports more than there is.
        if let Some(n_bytes) = memory::available_bytes() {
            gpu.limit_memory(n_bytes);
        }
    }
    Ok(gpu)
}

fn warn_fallback(error: &dyn std::error::Error) {
    output::warn(&format!("falling back to the CPU: {error}"));
}

impl Machine {
    /// The adapter, if one is used.
    pub(crate) fn gpu(&self) -> Option<&Gpu> {
        match self {
            Self::Cpu => None,
            Self::Device(gpu) | Self::Auto(gpu) | Self::Both(gpu) => Some(gpu),
        }
    }

    /// Runs `prepare` on the adapter. Returns `None` where the CPU computes instead.
    ///
    /// # Errors
    /// An adapter that was requested explicitly does not support the request, or the error is not the adapter's.
    pub(crate) fn ready<'a, T>(&'a self, prepare: impl FnOnce(&'a Gpu) -> Result<T, DeviceError>) -> Result<Option<T>> {
        let Some(gpu) = self.gpu() else { return Ok(None) };
        match prepare(gpu) {
            Ok(ready) => Ok(Some(ready)),
            Err(error) if matches!(self, Self::Auto(_)) && !matches!(error, DeviceError::Render(_)) => {
                warn_fallback(&error);
                Ok(None)
            }
            Err(error) => Err(self.named(error)),
        }
    }

    /// Adds the name of the adapter to an error of the adapter.
    pub(crate) fn named(&self, error: DeviceError) -> anyhow::Error {
        match (error, self.gpu()) {
            (DeviceError::Render(error), _) => error.into(),
            (DeviceError::Gpu(error), Some(gpu)) => anyhow!("{}: {error}", gpu.info().name),
            (error, _) => error.into(),
        }
    }
}

/// Rejects triangle tests that the GPU kernels do not support.
pub(crate) fn check_triangles(triangles: TriangleTest) -> Result<(), DeviceError> {
    match triangles {
        TriangleTest::Watertight => Ok(()),
        _ => Err(DeviceError::Unsupported { what: "triangle tests other than watertight" }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_device_names() {
        let parse = |text: &str| text.parse::<DeviceArg>();
        assert_eq!(parse("auto"), Ok(DeviceArg::Auto));
        assert_eq!(parse("both"), Ok(DeviceArg::Both(None)));
        assert_eq!(parse("both: Big GPU "), Ok(DeviceArg::Both(Some("Big GPU".to_owned()))));
        assert_eq!(parse("Big GPU"), Ok(DeviceArg::Named("Big GPU".to_owned())));
        assert!(parse("").is_err() && parse("both:").is_err() && parse(" ").is_err());
    }
}
