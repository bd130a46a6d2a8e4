//! The kernels that take samples, and what they keep of them.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_film::{Aovs, Components, Guide, Pixel, Sums};
use canted_gpu::{Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding, TracedScene, block_on, choice};

use super::picture::{CELL_PIXELS, Pace};
use super::streams::{StreamKernels, Streams};
use super::sums::{DeviceSums, PackedSample, PackedSum, SumKernels, read};

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

/// `first_light` of `shared/camera/first_light`: what the first surface reflects in a sample.
type PackedFirstLight = [[f32; 3]; 4];

/// `components` of `shared/camera/components`: the light of a sample in its parts.
type PackedComponents = [[f32; 3]; 3];

/// What kernels keep of each sample of a dispatch, on the device.
pub(super) struct Records {
    pub(super) samples: Buffer<PackedSample>,
    guides: Option<Buffer<PackedGuide>>,
    components: Option<Buffer<PackedComponents>>,
    first_light: Option<Buffer<PackedFirstLight>>,
}

/// The same on the host.
pub(super) struct Samples {
    light: Vec<PackedSample>,
    /// Empty where they are not requested, like the others.
    guides: Vec<PackedGuide>,
    components: Vec<PackedComponents>,
    first_light: Vec<PackedFirstLight>,
}

impl Records {
    /// Of so many samples, of a picture with these AOVs.
    pub(super) fn new(gpu: &Gpu, aovs: Aovs, n: usize) -> Result<Self, GpuError> {
        Ok(Self {
            samples: gpu.work_buffer("samples", n)?,
            guides: (!aovs.is_empty()).then(|| gpu.work_buffer("guides", n)).transpose()?,
            components: aovs.has_components().then(|| gpu.work_buffer("components", n)).transpose()?,
            first_light: aovs.has_factors().then(|| gpu.work_buffer("first_light", n)).transpose()?,
        })
    }

    /// Most bytes of a sample in one buffer.
    pub(super) fn n_bytes(aovs: Aovs) -> usize {
        if aovs.is_empty() { size_of::<PackedSample>() } else { size_of::<PackedGuide>() }
    }

    /// The bindings of kernels that write or sum them.
    pub(super) fn bindings(&self) -> impl Iterator<Item = NamedBinding<'_>> {
        let guides = self.guides.as_ref().map(|guides| -> NamedBinding<'_> { ("guides", guides) });
        let components = self.components.as_ref().map(|parts| -> NamedBinding<'_> { ("components", parts) });
        let first_light = self.first_light.as_ref().map(|parts| -> NamedBinding<'_> { ("first_light", parts) });
        let samples: NamedBinding<'_> = ("samples", &self.samples);
        [samples].into_iter().chain(guides).chain(components).chain(first_light)
    }

    /// Reads the first `n`, of which the light may be here.
    pub(super) fn read(&self, gpu: &Gpu, light: Option<Vec<PackedSample>>, n: usize) -> Result<Samples, GpuError> {
        Ok(Samples {
            light: light.map_or_else(|| read(gpu, Some(&self.samples), n), Ok)?,
            guides: read(gpu, self.guides.as_ref(), n)?,
            components: read(gpu, self.components.as_ref(), n)?,
            first_light: read(gpu, self.first_light.as_ref(), n)?,
        })
    }

    /// Overwrites the first ones.
    pub(super) fn write(&self, gpu: &Gpu, samples: &Samples) {
        gpu.write(&self.samples, &samples.light);
        if let Some(guides) = &self.guides {
            gpu.write(guides, &samples.guides);
        }
        if let Some(components) = &self.components {
            gpu.write(components, &samples.components);
        }
        if let Some(first_light) = &self.first_light {
            gpu.write(first_light, &samples.first_light);
        }
    }
}

impl Samples {
    /// Whether kernels did not finish something of a sample.
    pub(super) fn is_unfinished(&self, at: usize) -> bool {
        self.has_no_light(at) || self.guides.get(at).is_some_and(|guide| !guide.is_complete())
    }

    /// Whether they did not finish its light.
    fn has_no_light(&self, at: usize) -> bool {
        self.light[at][3] < 0.0
    }

    /// Stores what the CPU found of a sample, as kernels keep it. Light that they finished stays. Returns the number of rays, but for those
    /// that are stored with light.
    pub(super) fn complete(&mut self, at: usize, one: &Sums, n_rays: u64) -> u64 {
        let has_no_light = self.has_no_light(at);
        if has_no_light {
            let light = one.pixel.total();
            let sign = if light.n_negative > 0 { -1.0 } else { 1.0 };
            self.light[at] = packed(&light, sign, n_rays);
            let Components { sums, first } = one.components.total();
            if let Some(components) = self.components.get_mut(at) {
                *components = sums.map(|part| part.map(|x| (sign * x) as f32));
            }
            if let Some(first_light) = self.first_light.get_mut(at) {
                *first_light = first.unwrap_or_default().map(|part| part.map(|x| (sign * x) as f32));
            }
        }
        if let Some(guide) = self.guides.get_mut(at).filter(|guide| has_no_light || !guide.is_complete()) {
            *guide = PackedGuide::of(&one.guide.total());
        }
        if has_no_light { 0 } else { n_rays }
    }

    /// Adds sample number `sample` of a pixel to its sums, with a weight. Returns the number of rays.
    pub(super) fn add_to(&self, sums: &mut Sums, at: usize, sample: u32, weight: f32) -> u64 {
        let [red, green, blue, n_rays] = self.light[at];
        sums.pixel.push_sample(sample, Pixel::weighted([red, green, blue], weight));
        if let Some(guide) = self.guides.get(at) {
            sums.guide.push_sample(sample, guide.into());
        }
        if let Some(&parts) = self.components.get(at) {
            let first = self.first_light.get(at).copied();
            sums.components.push_sample(sample, Components::weighted(parts, first, weight));
        }
        n_rays as u64
    }
}

/// A sample that the CPU took, as kernels keep it, without the sign of its weight; of one that is dropped, only that its light is not finite.
fn packed(pixel: &Pixel, sign: f64, n_rays: u64) -> PackedSample {
    let light = if pixel.n_dropped > 0 { [f64::INFINITY; 3] } else { pixel.sum.map(|x| sign * x) };
    // Exact: light is that of an f32, and a sample has fewer rays than 2^24.
    let [red, green, blue] = light.map(|x| x as f32);
    [red, green, blue, n_rays as f32]
}

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
    /// One invocation traces all rays of a sample, for this reason.
    Whole(Arc<Kernel>, &'static str),
    /// Rays of many samples are traced together.
    Streams(StreamKernels),
}

impl RenderKernels {
    /// Most work-groups of a dispatch, of a picture with these AOVs.
    pub(super) fn max_groups(&self, gpu: &Gpu, aovs: Aovs, pace: &Pace) -> u32 {
        let limit = gpu.limits().max_storage_buffer_binding_size;
        let max = u32::try_from(limit / (CELL_PIXELS * Records::n_bytes(aovs)) as u64).unwrap_or(u32::MAX);
        match &self.light {
            LightKernels::Whole(..) => max,
            LightKernels::Streams(_) => max.min(StreamKernels::max_groups(gpu, pace)),
        }
    }

    /// Whether a kernel binds a variable of this name.
    pub(super) fn binds(&self, name: &str) -> bool {
        let of_light = match &self.light {
            LightKernels::Whole(kernel, _) => vec![kernel],
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
}

enum ReadyLight {
    Whole(Arc<Kernel>),
    Streams(Box<Streams>),
}

impl ReadyKernels {
    /// Kernels for at most `n_groups` work-groups of a dispatch, of at most `n_cells`, which take `n_samples` of a pixel.
    pub(super) fn new(
        gpu: &Gpu,
        traced: &TracedScene,
        (kernels, pace): (RenderKernels, &Arc<Pace>),
        [n_groups, n_cells, n_samples]: [u32; 3],
    ) -> Result<Self, GpuError> {
        let RenderKernels { light, guide, sums } = kernels;
        let light = match light {
            LightKernels::Whole(kernel, _) => ReadyLight::Whole(kernel),
            LightKernels::Streams(kernels) => {
                let n = n_groups as usize * CELL_PIXELS;
                ReadyLight::Streams(Box::new(Streams::new(gpu, traced, (kernels, pace.clone()), n)?))
            }
        };
        let sums = sums.map(|kernels| DeviceSums::new(gpu, kernels, [n_groups, n_cells, n_samples])).transpose()?;
        Ok(Self { light, guide, sums })
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
