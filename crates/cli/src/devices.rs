//! `canted devices`: what `--device` can choose from.

use anyhow::Result;
use canted_gpu::{AdapterInfo, AdapterKind, adapters};
use serde_json::{Value, json};

use crate::{Outcome, output};

/// Options of `canted devices`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Lists the CPU and all adapters, the ones to prefer first.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    let found = adapters();
    let n_threads = rayon::current_num_threads();
    output::to_stdout(&if args.json { as_json(&found, n_threads).to_string() } else { as_text(&found, n_threads) })?;
    Ok(Outcome::Done)
}

fn as_json(found: &[AdapterInfo], n_threads: usize) -> Value {
    let adapters: Vec<Value> = found
        .iter()
        .map(|facts| {
            json!({
                "name": facts.name, "kind": facts.kind.to_string(), "backend": facts.backend, "driver": facts.driver,
                "is_software": facts.kind == AdapterKind::Software, "max_binding_bytes": facts.max_binding_bytes,
                "max_buffer_bytes": facts.max_buffer_bytes, "has_timestamps": facts.has_timestamps,
            })
        })
        .collect();
    json!({ "cpu": { "threads": n_threads }, "adapters": adapters, "auto": auto(found).unwrap_or("cpu") })
}

fn as_text(found: &[AdapterInfo], n_threads: usize) -> String {
    let mut lines = vec![format!("cpu            {n_threads} threads")];
    for facts in found {
        let AdapterInfo { name, kind, backend, driver, .. } = facts;
        let mebibytes = facts.max_binding_bytes >> 20;
        lines.push(format!("gpu            {name} ({kind}, {backend}, {driver}), bindings of up to {mebibytes} MiB"));
    }
    lines.push(match (auto(found), found.is_empty()) {
        (Some(name), _) => format!("--device auto takes {name}"),
        (None, false) => "--device auto takes the CPU: software adapters are slower".to_owned(),
        (None, true) => {
            "--device auto takes the CPU: no adapter found (it needs a driver for Vulkan, Metal or DX12)".to_owned()
        }
    });
    lines.join("\n")
}

/// The adapter that is taken where nothing is said; `None` for the CPU.
fn auto(found: &[AdapterInfo]) -> Option<&str> {
    found.iter().find(|facts| facts.kind != AdapterKind::Software).map(|facts| facts.name.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(name: &str, kind: AdapterKind) -> AdapterInfo {
        AdapterInfo {
            name: name.to_owned(),
            kind,
            backend: "Vulkan".to_owned(),
            driver: "x 1".to_owned(),
            max_binding_bytes: 128 << 20,
            max_buffer_bytes: 1 << 30,
            has_timestamps: true,
        }
    }

    #[test]
    fn hardware_is_taken_and_software_is_not() {
        let software = facts("llvmpipe", AdapterKind::Software);
        assert_eq!(auto(std::slice::from_ref(&software)), None);
        let both = [facts("Big GPU", AdapterKind::Discrete), software];
        assert_eq!(auto(&both), Some("Big GPU"));
        assert!(as_text(&both, 4).ends_with("--device auto takes Big GPU"));
        assert_eq!(as_json(&both, 4)["auto"], "Big GPU");
        assert_eq!(as_json(&[], 4)["auto"], "cpu");
    }
}
