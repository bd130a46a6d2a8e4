//! What the feature `gpu` replaces: without it, the CPU is the only device.

use anyhow::{Result, anyhow};
use serde_json::Value;

use crate::{device::DeviceArg, options::StructureArgs};

/// The CPU.
pub(crate) enum Machine {
    Cpu,
}

impl Machine {
    /// Opens the CPU.
    ///
    /// # Errors
    /// Any other device.
    pub(crate) fn open(device: &DeviceArg, _: &StructureArgs) -> Result<Self> {
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
pub(crate) fn adapters() -> Vec<Value> {
    Vec::new()
}
