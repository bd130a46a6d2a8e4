//! `--device`: what computes.

use std::str::FromStr;

use anyhow::{Result, anyhow};
use canted_gpu::{AdapterKind, Choice, Gpu, GpuError};
use canted_renderer::DeviceError;

use crate::{memory, options::TrianglesArg, output};

/// What `--device` says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum DeviceArg {
    /// A GPU where there is one that knows what is asked, else the CPU.
    Auto,
    Cpu,
    /// The best adapter, software or not.
    Gpu,
    /// The CPU beside an adapter: one that is no software, or that of this name.
    Both(Option<String>),
    /// The best adapter whose name has this part.
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
                "" => return Err("a device is auto, cpu, gpu, both or a part of an adapter's name".to_owned()),
                name if text.starts_with("both:") => Self::Both(Some(name.to_owned())),
                name => Self::Named(name.to_owned()),
            },
        })
    }
}

/// What computes, open.
pub(crate) enum Machine {
    /// The CPU alone.
    Cpu,
    /// An adapter alone, because it was asked for.
    Device(Gpu),
    /// An adapter as far as it knows what is asked, else the CPU.
    Auto(Gpu),
    /// Both share the work out.
    Both(Gpu),
}

impl DeviceArg {
    /// Opens what is meant; a software driver is told of.
    ///
    /// # Errors
    /// An adapter that there is not, or that gives no device.
    pub(crate) fn open(&self) -> Result<Machine> {
        Ok(match self {
            Self::Cpu => Machine::Cpu,
            Self::Auto => match Gpu::open(&Choice::Hardware) {
                Ok(gpu) => Machine::Auto(gpu),
                Err(GpuError::NoAdapter { .. }) => Machine::Cpu,
                Err(error) => {
                    instead(&error);
                    Machine::Cpu
                }
            },
            Self::Gpu => Machine::Device(opened(&Choice::Best)?),
            Self::Named(name) => Machine::Device(opened(&Choice::Named(name.clone()))?),
            Self::Both(Some(name)) => Machine::Both(opened(&Choice::Named(name.clone()))?),
            Self::Both(None) => match Gpu::open(&Choice::Hardware) {
                Ok(gpu) => Machine::Both(gpu),
                Err(GpuError::NoAdapter { found, .. }) if !found.is_empty() => {
                    let name = &found[0];
                    output::to_stderr(&format!(
                        "warning: the CPU computes alone: '{name}' is a software driver and takes the same cores; \
                         --device both:NAME takes it all the same"
                    ));
                    Machine::Cpu
                }
                Err(error) => return Err(anyhow!("{error}")),
            },
        })
    }
}

fn opened(choice: &Choice) -> Result<Gpu> {
    let gpu = Gpu::open(choice).map_err(|error| anyhow!("{error}"))?;
    let facts = gpu.info();
    if facts.kind == AdapterKind::Software {
        let name = &facts.name;
        output::to_stderr(&format!("warning: '{name}' is a software driver: it computes on the CPU, and slower"));
        // Its memory is this machine's, of which it gives more than there is.
        if let Some(n_bytes) = memory::available_bytes() {
            gpu.limit_memory(n_bytes);
        }
    }
    Ok(gpu)
}

/// Tells that the CPU computes in place of a device.
fn instead(why: &dyn std::error::Error) {
    output::to_stderr(&format!("warning: the CPU computes: {why}"));
}

impl Machine {
    /// The adapter, if any has a part in it.
    pub(crate) fn gpu(&self) -> Option<&Gpu> {
        match self {
            Self::Cpu => None,
            Self::Device(gpu) | Self::Auto(gpu) | Self::Both(gpu) => Some(gpu),
        }
    }

    /// What is ready on the device; `None` where the CPU computes, also because the device does not know what is asked.
    ///
    /// # Errors
    /// What was asked of the device by name and it does not do, and what is no matter of devices.
    pub(crate) fn ready<'a, T>(&'a self, prepare: impl FnOnce(&'a Gpu) -> Result<T, DeviceError>) -> Result<Option<T>> {
        let Some(gpu) = self.gpu() else { return Ok(None) };
        match prepare(gpu) {
            Ok(ready) => Ok(Some(ready)),
            Err(error @ DeviceError::Render(_)) => Err(self.named(error)),
            Err(error) if matches!(self, Self::Auto(_)) => {
                instead(&error);
                Ok(None)
            }
            Err(error) => Err(self.named(error)),
        }
    }

    /// An error with the name of the device, where it is the device's.
    pub(crate) fn named(&self, error: DeviceError) -> anyhow::Error {
        match (error, self.gpu()) {
            (DeviceError::Render(error), _) => error.into(),
            (DeviceError::Gpu(error), Some(gpu)) => anyhow!("{}: {error}", gpu.info().name),
            (error, _) => anyhow!("{error}"),
        }
    }
}

/// Refuses triangle tests that kernels do not have.
pub(crate) fn check_triangles(triangles: TrianglesArg) -> Result<(), DeviceError> {
    match triangles {
        TrianglesArg::Watertight => Ok(()),
        _ => Err(DeviceError::Unknown { what: "triangle tests other than watertight" }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_read_by_their_names() {
        let read = |text: &str| text.parse::<DeviceArg>();
        assert_eq!(read("auto"), Ok(DeviceArg::Auto));
        assert_eq!(read("both"), Ok(DeviceArg::Both(None)));
        assert_eq!(read("both: Big GPU "), Ok(DeviceArg::Both(Some("Big GPU".to_owned()))));
        assert_eq!(read("Big GPU"), Ok(DeviceArg::Named("Big GPU".to_owned())));
        assert!(read("").is_err() && read("both:").is_err() && read(" ").is_err());
    }
}
