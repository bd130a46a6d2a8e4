//! How a command runs: on which device, with how many threads.

#[cfg(feature = "gpu")]
mod gpu;

use std::str::FromStr;

use anyhow::{Result, anyhow};

use crate::options::{self, Text};
#[cfg(feature = "gpu")]
pub(crate) use gpu::{Machine, adapters, built_or, named};

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

impl Text for DeviceArg {
    fn text(&self) -> String {
        match self {
            Self::Auto => "auto".to_owned(),
            Self::Cpu => "cpu".to_owned(),
            Self::Gpu => "gpu".to_owned(),
            Self::Both(None) => "both".to_owned(),
            Self::Both(Some(name)) => format!("both:{name}"),
            Self::Named(name) => name.clone(),
        }
    }
}

/// The options about how a command runs.
#[derive(clap::Args, Clone)]
#[command(next_help_heading = "Run", next_display_order = 20)]
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
    /// Starts the threads of a command that cannot share its work between CPU and GPU.
    pub(crate) fn start(&self) -> Result<()> {
        if matches!(self.device, DeviceArg::Both(_)) {
            return Err(anyhow!("--device both requires `canted render`; use cpu, gpu or an adapter name"));
        }
        options::use_threads(self.threads)
    }
}

/// The CPU, which is the only device without the feature `gpu`.
#[cfg(not(feature = "gpu"))]
pub(crate) enum Machine {
    Cpu,
}

#[cfg(not(feature = "gpu"))]
impl Machine {
    /// Opens the CPU.
    ///
    /// # Errors
    /// Any other device.
    pub(crate) fn open(device: &DeviceArg, _: &options::Structure) -> Result<Self> {
        match device {
            DeviceArg::Auto | DeviceArg::Cpu => Ok(Self::Cpu),
            _ => Err(anyhow!("this program was built without GPU support; use --device cpu")),
        }
    }

    /// What computes.
    pub(crate) fn name(&self) -> String {
        "cpu".to_owned()
    }
}

/// Lists no adapters.
#[cfg(not(feature = "gpu"))]
pub(crate) fn adapters() -> Vec<serde_json::Value> {
    Vec::new()
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
