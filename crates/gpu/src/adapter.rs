//! Adapters: listed, described, chosen.

use wgpu::{Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags};

use crate::GpuError;

/// Properties of an adapter, available before it is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Name reported by the driver.
    pub name: String,
    /// Kind of adapter.
    pub kind: AdapterKind,
    /// Graphics API: `Vulkan`, `Metal`, `Dx12`, or `BrowserWebGpu`.
    pub backend: String,
    /// Driver name and version, if reported.
    pub driver: String,
    /// Maximum size of a storage buffer binding, in bytes.
    pub max_binding_bytes: u64,
    /// Maximum size of a buffer, in bytes.
    pub max_buffer_bytes: u64,
    /// Whether the adapter supports timestamp queries.
    pub has_timestamps: bool,
    /// Whether its driver traces rays by ray queries: [`Gpu::with_ray_queries`](crate::Gpu::with_ray_queries).
    pub has_ray_queries: bool,
}

/// Kinds of adapters, in order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A GPU with dedicated memory.
    Discrete,
    /// A GPU that shares memory with the CPU.
    Integrated,
    /// A virtualized GPU.
    Virtual,
    /// Unknown.
    Other,
    /// A software driver that runs on the CPU.
    Software,
}

impl std::fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Other => "unknown kind",
            Self::Software => "software",
        })
    }
}

/// Which adapter to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The first adapter of the best kind, a software driver as a last resort.
    Best,
    /// The first hardware adapter of the best kind.
    Hardware,
    /// The best adapter whose name contains this text, ignoring case.
    Named(String),
}

impl std::fmt::Display for Choice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Best => f.write_str("gpu"),
            Self::Hardware => f.write_str("hardware gpu"),
            Self::Named(name) => f.write_str(name),
        }
    }
}

const BACKENDS: Backends =
    Backends::VULKAN.union(Backends::METAL).union(Backends::DX12).union(Backends::BROWSER_WEBGPU);

/// Share of the reported memory budget that buffers may use.
const MEMORY_PERCENT: u8 = 95;

/// All adapters in order of preference; empty if no driver is installed. A browser offers one at most.
///
/// # Errors
/// None; a result, so that it can be passed to [`block_on`](crate::block_on).
pub async fn adapters() -> Result<Vec<AdapterInfo>, GpuError> {
    Ok(listed().await.iter().map(facts).collect())
}

/// The chosen adapter and its properties.
pub(crate) async fn choose(choice: &Choice) -> Result<(wgpu::Adapter, AdapterInfo), GpuError> {
    let all = listed().await;
    let found = all.iter().map(|adapter| adapter.get_info().name).collect();
    let fits = |facts: &AdapterInfo| match choice {
        Choice::Best => true,
        Choice::Hardware => facts.kind != AdapterKind::Software,
        Choice::Named(name) => facts.name.to_lowercase().contains(&name.to_lowercase()),
    };
    all.into_iter()
        .map(|adapter| {
            let facts = facts(&adapter);
            (adapter, facts)
        })
        .find(|(_, facts)| fits(facts))
        .ok_or_else(|| GpuError::NoAdapter { wanted: choice.to_string(), found })
}

async fn listed() -> Vec<wgpu::Adapter> {
    let mut descriptor = InstanceDescriptor::new_without_display_handle();
    descriptor.backends = BACKENDS;
    // Debug builds would hand the source of shaders to the driver, for which naga counts lines before each statement: a sixth of the time of
    // tests on a software driver. `WGPU_DEBUG=1` brings it back.
    descriptor.flags = descriptor.flags.difference(InstanceFlags::DEBUG).with_env();
    // If the driver reports a memory budget, exceeding it is an error rather than an out-of-memory kill by the system.
    descriptor.memory_budget_thresholds.for_resource_creation = Some(MEMORY_PERCENT);
    let mut all = Instance::new(descriptor).enumerate_adapters(BACKENDS).await;
    all.sort_by_key(|adapter| kind(adapter.get_info().device_type));
    all
}

fn kind(device_type: DeviceType) -> AdapterKind {
    match device_type {
        DeviceType::DiscreteGpu => AdapterKind::Discrete,
        DeviceType::IntegratedGpu => AdapterKind::Integrated,
        DeviceType::VirtualGpu => AdapterKind::Virtual,
        DeviceType::Other => AdapterKind::Other,
        DeviceType::Cpu => AdapterKind::Software,
    }
}

fn facts(adapter: &wgpu::Adapter) -> AdapterInfo {
    facts_of(adapter.get_info(), &adapter.limits(), adapter.features())
}

/// Properties of an adapter or of a device, which may have lower limits.
pub(crate) fn facts_of(info: wgpu::AdapterInfo, limits: &wgpu::Limits, features: wgpu::Features) -> AdapterInfo {
    AdapterInfo {
        kind: kind(info.device_type),
        backend: format!("{:?}", info.backend),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        name: info.name,
        max_binding_bytes: limits.max_storage_buffer_binding_size,
        max_buffer_bytes: limits.max_buffer_size,
        has_timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
        has_ray_queries: features.contains(wgpu::Features::EXPERIMENTAL_RAY_QUERY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_adapter_is_reported() {
        let error = crate::block_on(choose(&Choice::Named("no such adapter".to_owned()))).unwrap_err().to_string();
        assert!(error.starts_with("no adapter for device 'no such adapter'"), "{error}");
    }

    #[test]
    fn software_drivers_are_last() {
        let kinds: Vec<_> = crate::block_on(adapters()).unwrap().iter().map(|facts| facts.kind).collect();
        assert!(kinds.is_sorted(), "{kinds:?}");
        assert!(AdapterKind::Discrete < AdapterKind::Integrated && AdapterKind::Other < AdapterKind::Software);
    }
}
