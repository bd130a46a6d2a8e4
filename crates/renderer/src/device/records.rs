//! The kernels that take samples, and what they keep of them.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_film::{Aovs, Guide};
use canted_gpu::{Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding, TracedScene, block_on, choice};

use super::picture::{CELL_PIXELS, Pace};
use super::streams::{StreamKernels, Streams};
use super::sums::{DeviceSums, PackedSample, PackedSum, SumKernels};

/// `Guide` of `render/guide`: the AOVs of a sample.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PackedGuide {
    normal: [f32; 3],
    depth: f32,
    shading_normal: [f32; 3],
    n_boxes: f32,
    albedo: [f32; 3],
    n_triangles: f32,
    /// `u32::MAX` for a miss, the number below if the traversal was cut short.
    primitive: u32,
    /// `u32::MAX` for a miss and for a light.
    instance: u32,
    padding: [u32; 2],
}

impl PackedGuide {
    /// What the CPU found of a sample, as kernels keep it.
    pub(super) fn of(guide: &Guide) -> Self {
        let narrow = |v: [f64; 3]| v.map(|x| x as f32);
        let [instance, primitive] = guide.first.unwrap_or([u32::MAX, if guide.n_hits > 0 { 0 } else { u32::MAX }]);
        let [n_boxes, n_triangles] = guide.tests.map(|n| n as f32);
        Self {
            normal: narrow(guide.normal),
            depth: guide.depth as f32,
            shading_normal: narrow(guide.shading_normal),
            n_boxes,
            albedo: narrow(guide.albedo),
            n_triangles,
            primitive,
            instance,
            padding: [0; 2],
        }
    }

    /// Whether the traversal of the camera ray was not cut short.
    pub(super) fn is_complete(&self) -> bool {
        self.primitive != u32::MAX - 1
    }
}

impl From<&PackedGuide> for Guide {
    fn from(guide: &PackedGuide) -> Self {
        let is_triangle = guide.instance != u32::MAX;
        // Without negative zeros, which sums would lose or not by the order of their terms.
        let number = |x: f32| if x.is_finite() { f64::from(x) + 0.0 } else { 0.0 };
        Self {
            n_hits: (is_triangle || guide.primitive != u32::MAX).into(),
            first: is_triangle.then_some([guide.instance, guide.primitive]),
            depth: number(guide.depth),
            normal: guide.normal.map(number),
            shading_normal: guide.shading_normal.map(number),
            albedo: guide.albedo.map(number),
            tests: [guide.n_boxes, guide.n_triangles].map(f64::from),
        }
    }
}

/// `FirstLight` of `shared/camera/first_light`: what the first surface reflects in a sample.
pub(super) type PackedFirstLight = [[f32; 3]; 4];

/// `Components` of `shared/camera/components`: the light of a sample in its parts.
pub(super) type PackedComponents = [[f32; 3]; 3];

/// Compiled kernels.
#[derive(Clone)]
pub(super) struct RenderKernels {
    /// Compute radiance.
    pub(super) light: LightKernels,
    /// Writes AOVs, if requested.
    pub(super) guide: Option<Arc<Kernel>>,
    /// Sum samples, where the device does.
    pub(super) sums: Option<SumKernels>,
}

/// How radiance is computed.
#[derive(Clone)]
pub(super) enum LightKernels {
    /// One invocation traces all rays of a sample.
    Whole(Arc<Kernel>),
    /// Rays of many samples are traced together.
    Streams(StreamKernels),
}

impl RenderKernels {
    /// Whether a kernel binds a variable of this name.
    pub(super) fn binds(&self, name: &str) -> bool {
        let of_light = match &self.light {
            LightKernels::Whole(kernel) => vec![kernel],
            LightKernels::Streams(kernels) => kernels.all().collect(),
        };
        let binds = |kernel: &Arc<Kernel>| kernel.bindings().iter().any(|binding| binding.name == name);
        of_light.into_iter().chain(&self.guide).any(binds)
    }
}

/// Kernels with their own buffers.
pub(super) struct ReadyKernels {
    light: ReadyLight,
    guide: Option<Arc<Kernel>>,
    pub(super) sums: Option<DeviceSums>,
    /// Work-groups of a dispatch.
    pub(super) max_groups: u32,
    /// Whether the parts of the light are written.
    pub(super) has_components: bool,
    /// Whether the light at the first surface is written.
    pub(super) has_first_light: bool,
}

enum ReadyLight {
    Whole(Arc<Kernel>),
    Streams(Box<Streams>),
}

impl ReadyKernels {
    /// Kernels for at most `max` work-groups, which take `n_samples` of a pixel.
    pub(super) fn new(
        gpu: &Gpu,
        traced: &TracedScene,
        (kernels, pace): (RenderKernels, &Arc<Pace>),
        (max, n_samples): (u32, u32),
    ) -> Result<Self, GpuError> {
        let limit = gpu.limits().max_storage_buffer_binding_size;
        let fit = |bytes: usize| u32::try_from(limit / (CELL_PIXELS * bytes) as u64).unwrap_or(u32::MAX);
        let max = max.min(fit(size_of::<PackedSample>()));
        let max = if kernels.guide.is_some() { max.min(fit(size_of::<PackedGuide>())) } else { max };
        let has_components = kernels.binds("components");
        let max = if has_components { max.min(fit(size_of::<PackedComponents>())) } else { max };
        let has_first_light = kernels.binds("first_light");
        let max = if has_first_light { max.min(fit(size_of::<PackedFirstLight>())) } else { max };
        let RenderKernels { light, guide, sums } = kernels;
        let (light, max_groups) = match light {
            LightKernels::Whole(kernel) => (ReadyLight::Whole(kernel), max),
            LightKernels::Streams(kernels) => {
                let max = max.min(StreamKernels::max_groups(gpu, pace));
                let (streams, n) = Streams::new(gpu, traced, (&kernels, pace), max as usize * CELL_PIXELS)?;
                (ReadyLight::Streams(Box::new(streams)), (n / CELL_PIXELS) as u32)
            }
        };
        let sums = sums.map(|kernels| DeviceSums::new(gpu, kernels, (max_groups, n_samples))).transpose()?;
        Ok(Self { light, guide, sums, max_groups, has_components, has_first_light })
    }

    /// Whether AOVs are written.
    pub(super) fn has_guides(&self) -> bool {
        self.guide.is_some()
    }

    /// Takes the samples of `n` work-groups, of so many cells, and waits for them.
    pub(super) fn run(&mut self, gpu: &Gpu, bindings: &[NamedBinding<'_>], size: [u32; 2]) -> Result<(), GpuError> {
        let [n, _] = size;
        let mut commands = gpu.commands();
        let groups = |kernel: &Kernel| kernel.groups(n * kernel.group_size());
        match &mut self.light {
            ReadyLight::Whole(kernel) => commands.dispatch(kernel, bindings, groups(kernel))?,
            ReadyLight::Streams(streams) => streams.record(&mut commands, bindings, n)?,
        }
        if let Some(guide) = &self.guide {
            commands.dispatch(guide, bindings, groups(guide))?;
        }
        self.finish(commands, bindings, size)
    }

    /// Takes the rest of these samples, where [`Self::read`] finds that some are not done.
    pub(super) fn run_rest(
        &mut self,
        gpu: &Gpu,
        bindings: &[NamedBinding<'_>],
        size: [u32; 2],
    ) -> Result<(), GpuError> {
        let mut commands = gpu.commands();
        if let ReadyLight::Streams(streams) = &mut self.light {
            streams.record_rest(&mut commands, bindings)?;
        }
        self.finish(commands, bindings, size)
    }

    /// Sums samples, where the device does, and waits for all that is recorded.
    pub(super) fn finish(
        &self,
        mut commands: Commands<'_>,
        bindings: &[NamedBinding<'_>],
        size: [u32; 2],
    ) -> Result<(), GpuError> {
        if let Some(sums) = &self.sums {
            sums.record(&mut commands, bindings, size)?;
        }
        block_on(commands.run())
    }

    /// Reads so many samples, or sums where the device makes them, and what the last dispatch did.
    pub(super) fn read(
        &mut self,
        gpu: &Gpu,
        samples: &Buffer<PackedSample>,
        [n_samples, n_sums]: [usize; 2],
    ) -> Result<(Vec<PackedSample>, Vec<PackedSum>, Took), GpuError> {
        let mut beside = match &mut self.light {
            ReadyLight::Whole(_) => vec![],
            ReadyLight::Streams(streams) => streams.beside(),
        };
        let (samples, sums, mut words) = match &self.sums {
            None => {
                let (samples, words) = block_on(gpu.read_beside(samples, n_samples, &beside))?;
                (samples, vec![], words)
            }
            Some(device) => {
                beside.push((&device.n_unfinished, 1));
                let (sums, words) = block_on(gpu.read_beside(&device.light.sums, n_sums, &beside))?;
                (vec![], sums, words)
            }
        };
        let has_unfinished = self.sums.is_some() && words.pop().is_some_and(|n| n > 0);
        let (n_exact_rays, is_done) = match &mut self.light {
            ReadyLight::Whole(_) => (0, true),
            ReadyLight::Streams(streams) => streams.took(&words),
        };
        Ok((samples, sums, Took { n_exact_rays, is_done, has_unfinished }))
    }
}

/// What a dispatch did.
pub(super) struct Took {
    /// Rays of streams that exact kernels traced.
    pub(super) n_exact_rays: u64,
    /// Whether all samples are done.
    pub(super) is_done: bool,
    /// Whether the device does not sum samples, because the CPU must take some.
    pub(super) has_unfinished: bool,
}

/// The part of the kernels that keeps the parts of the light, if they are requested.
pub(super) fn components(aovs: Aovs) -> choice::Components {
    if aovs.has_components() { choice::Components::Three } else { choice::Components::None }
}

/// The part of the kernel of `hybrid` that keeps the light at the first surface, if it is requested.
pub(super) fn first_light(aovs: Aovs) -> choice::FirstLight {
    if aovs.has_factors() { choice::FirstLight::Four } else { choice::FirstLight::None }
}
