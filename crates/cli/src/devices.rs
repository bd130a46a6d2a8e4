//! `canted devices`: the devices that `--device` can select.

use anyhow::Result;
use serde_json::{Value, json};

use crate::{device, output};

/// Options of `canted devices`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  canted devices\n  canted devices --json")]
pub(crate) struct Args {
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// Lists the CPU and all adapters, preferred ones first.
pub(crate) fn run(args: &Args) -> Result<()> {
    let adapters = device::adapters();
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
        lines.push(format!(
            "gpu            {name} ({kind}, {backend}, {driver}), buffer bindings up to {mebibytes} MiB"
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
    fn auto_selects_hardware_and_not_software() {
        let adapter = |name: &str, is_software: bool| json!({ "name": name, "is_software": is_software });
        let software = adapter("llvmpipe", true);
        assert_eq!(auto(std::slice::from_ref(&software)), None);
        let both = [adapter("Big GPU", false), software];
        assert_eq!(auto(&both), Some("Big GPU"));
        assert!(text(&both, 4).ends_with("--device auto selects Big GPU"));
        assert_eq!(auto(&[]), None);
    }
}
