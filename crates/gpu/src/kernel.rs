//! Compiled kernels.

use canted_shaders::{Binding, BindingKind, Entry, Shader, ShaderName, Variant};
use wgpu::{
    ComputePipelineDescriptor, Limits, PipelineCache, PipelineCompilationOptions, ShaderModuleDescriptor, ShaderSource,
};

use crate::{GpuError, trusted};

/// A compute kernel on a device.
pub struct Kernel {
    pub(crate) name: String,
    pub(crate) pipeline: wgpu::ComputePipeline,
    entry: Entry,
}

impl Kernel {
    /// `is_checked`: whether it keeps the checks of `wgpu` also where it needs none. `cache`: pipelines that need not be compiled again.
    pub(crate) fn new(
        device: &wgpu::Device,
        limits: &Limits,
        name: ShaderName,
        chosen: &Variant,
        is_checked: bool,
        cache: Option<&PipelineCache>,
    ) -> Result<Self, GpuError> {
        let shader = Shader::new(name, chosen)?;
        let entry =
            shader.entry("main").ok_or_else(|| GpuError::Invalid { message: format!("'{name}' has no main") })?;
        fits(name.as_str(), entry, limits)?;
        let descriptor = ShaderModuleDescriptor {
            label: Some(name.as_str()),
            source: ShaderSource::Wgsl(shader.source.as_str().into()),
        };
        let module = if is_checked || !trusted::is_proved(name) {
            device.create_shader_module(descriptor)
        } else {
            trusted::module(device, name, descriptor)
        };
        let pipeline = device.create_compute_pipeline(&ComputePipelineDescriptor {
            label: Some(name.as_str()),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: PipelineCompilationOptions { constants: &shader.overrides, ..Default::default() },
            cache,
        });
        Ok(Self { name: name.to_string(), pipeline, entry: entry.clone() })
    }

    /// Its bindings.
    #[must_use]
    pub fn bindings(&self) -> &[Binding] {
        &self.entry.bindings
    }

    /// Invocations per work-group.
    #[must_use]
    pub fn group_size(&self) -> u32 {
        self.entry.workgroup_size.iter().product()
    }

    /// Work-groups for `items` invocations, in rows within the limit of an axis; see `shared.wgsl`.
    #[must_use]
    pub fn groups(&self, items: u32) -> [u32; 3] {
        const MOST: u32 = 65_535;
        let groups = items.div_ceil(self.group_size());
        // Rows of equal length leave few idle work-groups.
        let rows = groups.div_ceil(MOST).max(1);
        [groups.div_ceil(rows), rows, 1]
    }
}

/// Checks a kernel against the limits of the device; `wgpu` does not check all of them.
pub(crate) fn fits(kernel: &str, entry: &Entry, limits: &Limits) -> Result<(), GpuError> {
    let remedy = "use another device";
    let check = |need: u32, most: u32, limit: &'static str| {
        if need <= most {
            return Ok(());
        }
        Err(GpuError::Limit { what: format!("kernel '{kernel}'"), need: need.into(), limit, most: most.into(), remedy })
    };
    let count =
        |wanted: fn(&BindingKind) -> bool| entry.bindings.iter().filter(|binding| wanted(&binding.kind)).count() as u32;
    let invocations: u32 = entry.workgroup_size.iter().product();
    check(invocations, limits.max_compute_invocations_per_workgroup, "invocations per work-group")?;
    check(entry.workgroup_bytes, limits.max_compute_workgroup_storage_size, "bytes of work-group memory")?;
    let storage = count(|kind| matches!(kind, BindingKind::Storage { .. }));
    check(storage, limits.max_storage_buffers_per_shader_stage, "storage buffers per stage")?;
    let uniform = count(|kind| matches!(kind, BindingKind::Uniform));
    check(uniform, limits.max_uniform_buffers_per_shader_stage, "uniform buffers per stage")?;
    let buffers = storage + uniform + count(|kind| matches!(kind, BindingKind::AccelerationStructure));
    check(buffers, limits.max_buffers_and_acceleration_structures_per_shader_stage, "buffers per stage")
}
