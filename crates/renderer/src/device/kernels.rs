//! The kernels that take samples, and their buffers.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_gpu::{Gpu, GpuError, Kernel, NamedBinding};

/// Pixels of a cell, and invocations of a work-group.
pub(super) const CELL_PIXELS: usize = 64;

/// `Guide` of `render/guide`: the AOVs of a sample.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PackedGuide {
    pub(super) normal: [f32; 3],
    pub(super) depth: f32,
    pub(super) shading_normal: [f32; 3],
    pub(super) n_boxes: f32,
    pub(super) albedo: [f32; 3],
    pub(super) n_triangles: f32,
    /// `u32::MAX` for a miss, the number below if the traversal was cut short.
    pub(super) primitive: u32,
    /// `u32::MAX` for a miss and for a light.
    pub(super) instance: u32,
    padding: [u32; 2],
}

/// Compiled kernels.
#[derive(Clone)]
pub(super) struct RenderKernels {
    /// Computes radiance: one invocation traces all rays of a sample.
    pub(super) light: Arc<Kernel>,
    /// Writes AOVs, if requested.
    pub(super) guide: Option<Arc<Kernel>>,
}

impl RenderKernels {
    /// Whether a kernel binds a variable of this name.
    pub(super) fn binds(&self, name: &str) -> bool {
        [&self.light]
            .into_iter()
            .chain(&self.guide)
            .any(|kernel| kernel.bindings().iter().any(|binding| binding.name == name))
    }
}

/// Kernels with their own buffers.
pub(super) struct ReadyKernels {
    kernels: RenderKernels,
    /// Work-groups of a dispatch.
    pub(super) max_groups: u32,
}

impl ReadyKernels {
    /// Kernels for at most `max` work-groups.
    pub(super) fn new(gpu: &Gpu, kernels: RenderKernels, max: u32) -> Self {
        let limit = gpu.limits().max_storage_buffer_binding_size;
        let fit = |bytes: usize| u32::try_from(limit / (CELL_PIXELS * bytes) as u64).unwrap_or(u32::MAX);
        let max = if kernels.guide.is_some() { max.min(fit(size_of::<PackedGuide>())) } else { max };
        Self { kernels, max_groups: max }
    }

    /// Whether AOVs are written.
    pub(super) fn has_guides(&self) -> bool {
        self.kernels.guide.is_some()
    }

    /// Takes the samples of `n` work-groups and waits for them.
    pub(super) fn run(&self, gpu: &Gpu, bindings: &[NamedBinding<'_>], n: u32) -> Result<(), GpuError> {
        let mut commands = gpu.commands();
        for kernel in [&self.kernels.light].into_iter().chain(&self.kernels.guide) {
            commands.dispatch(kernel, bindings, kernel.groups(n * kernel.group_size()))?;
        }
        commands.run()
    }
}
