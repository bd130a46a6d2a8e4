//! How a command runs: on which device, with how many threads; `canted devices`.

#[cfg(feature = "gpu")]
mod gpu;

use anyhow::{Result, anyhow};
use serde_json::{Value, json};

use crate::{
    options::{self, Form, Text},
    output,
};
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

impl Form for DeviceArg {
    type Value = Self;

    fn parse(text: &str) -> Result<Self, String> {
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
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Run", next_display_order = 20)]
pub(crate) struct RunArgs {
    /// Compute device: auto, cpu, gpu, or part of an adapter name (see `canted devices`). `auto` uses a hardware GPU that
    /// supports the scene, else the CPU.
    #[arg(long, default_value = "auto", value_parser = DeviceArg::parse, value_name = "DEVICE")]
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

    /// Whether results come back over a bus.
    #[expect(clippy::unused_self, reason = "machines with a GPU have another answer")]
    pub(crate) fn has_bus(&self) -> bool {
        false
    }

    /// Whether an adapter traces the rays.
    #[expect(clippy::unused_self, reason = "machines with a GPU have another answer")]
    pub(crate) fn traces_on_gpu(&self) -> bool {
        false
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

/// Options of `canted devices`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  canted devices\n  canted devices --json")]
pub(crate) struct DevicesArgs {
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// Lists the CPU and all adapters, preferred ones first.
pub(crate) fn list(args: &DevicesArgs) -> Result<()> {
    let adapters = adapters();
    let n_threads = rayon::current_num_threads();
    if args.json {
        let auto = auto(&adapters).unwrap_or("cpu");
        let report = json!({ "cpu": { "threads": n_threads }, "adapters": adapters, "auto": auto });
        return output::to_stdout(&report.to_string());
    }
    output::to_stdout(&text(&adapters, n_threads))
}

fn text(adapters: &[Value], n_threads: usize) -> String {
    let mut lines = vec![format!("cpu            {n_threads} threads")];
    for adapter in adapters {
        let [name, kind, backend, driver] = ["name", "kind", "backend", "driver"].map(|key| word(adapter, key));
        let mebibytes = adapter["max_binding_bytes"].as_u64().unwrap_or(0) >> 20;
        let queries = if adapter["has_ray_queries"] == true { ", ray queries" } else { "" };
        lines.push(format!(
            "gpu            {name} ({kind}, {backend}, {driver}), buffer bindings up to {mebibytes} MiB{queries}"
        ));
    }
    let reason = match auto(adapters) {
        Some(name) => name.to_owned(),
        None if !adapters.is_empty() => "the CPU: software adapters are slower".to_owned(),
        None if cfg!(feature = "gpu") => {
            "the CPU: no adapter found (a driver for Vulkan, Metal or DX12 is required)".to_owned()
        }
        None => "the CPU: this program was built without GPU support".to_owned(),
    };
    lines.push(format!("--device auto selects {reason}"));
    lines.join("\n")
}

fn word<'a>(adapter: &'a Value, key: &str) -> &'a str {
    adapter[key].as_str().unwrap_or_default()
}

/// The adapter that `--device auto` selects; `None` for the CPU.
fn auto(adapters: &[Value]) -> Option<&str> {
    adapters.iter().find(|adapter| adapter["is_software"] != true).map(|adapter| word(adapter, "name"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_device_names() {
        let parse = DeviceArg::parse;
        assert_eq!(parse("auto"), Ok(DeviceArg::Auto));
        assert_eq!(parse("both"), Ok(DeviceArg::Both(None)));
        assert_eq!(parse("both: Big GPU "), Ok(DeviceArg::Both(Some("Big GPU".to_owned()))));
        assert_eq!(parse("Big GPU"), Ok(DeviceArg::Named("Big GPU".to_owned())));
        assert!(parse("").is_err() && parse("both:").is_err() && parse(" ").is_err());
    }

    #[test]
    fn auto_selects_hardware_and_not_software() {
        let adapter = |name: &str, is_software: bool| json!({ "name": name, "is_software": is_software });
        let software = adapter("llvmpipe", true);
        assert_eq!(auto(std::slice::from_ref(&software)), None);
        let both = [adapter("Big GPU", false), software];
        assert_eq!(auto(&both), Some("Big GPU"));
        assert!(text(&both, 4).ends_with("--device auto selects Big GPU"));
        assert_eq!(auto(&[]), None);
        let with = |has: bool| text(&[json!({ "name": "Big GPU", "has_ray_queries": has })], 4);
        assert!(with(true).contains(" MiB, ray queries\n") && !with(false).contains("ray queries"));
    }
}
