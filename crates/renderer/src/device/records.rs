//! The kernels that take samples, and what they keep of them: every sample, or sums of blocks of them.
//!
//! ```text
//! reads   records of a kernel, one per pixel and block of samples
//! writes  sums of the block, and the samples that the CPU must take
//! holds   a block has the sum of its halves, as on the CPU: in f64, or in f32 for blocks that the device sums
//! source  shaders/shared/camera.wgsl, `film`
//! ```

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_film::{Aovs, Block, Pixel};
use canted_gpu::{Buffer, Gpu, GpuError, Kernel, NamedBinding, TracedScene, block_on, choice};

use super::picture::{CELL_PIXELS, Pace};
use super::streams::{StreamKernels, Streams};

use crate::SampleSums;

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
    /// Kernels for at most `max` work-groups.
    pub(super) fn new(
        gpu: &Gpu,
        traced: &TracedScene,
        (kernels, pace): (RenderKernels, &Arc<Pace>),
        max: u32,
    ) -> Result<Self, GpuError> {
        let limit = gpu.limits().max_storage_buffer_binding_size;
        let fit = |bytes: usize| u32::try_from(limit / (CELL_PIXELS * bytes) as u64).unwrap_or(u32::MAX);
        let max = if kernels.guide.is_some() { max.min(fit(size_of::<PackedGuide>())) } else { max };
        let has_components = kernels.binds("components");
        let max = if has_components { max.min(fit(size_of::<PackedComponents>())) } else { max };
        let has_first_light = kernels.binds("first_light");
        let max = if has_first_light { max.min(fit(size_of::<PackedFirstLight>())) } else { max };
        let RenderKernels { light, guide } = kernels;
        let (light, max_groups) = match light {
            LightKernels::Whole(kernel) => (ReadyLight::Whole(kernel), max),
            LightKernels::Streams(kernels) => {
                let max = max.min(StreamKernels::max_groups(gpu));
                let (streams, n) = Streams::new(gpu, traced, (&kernels, pace), max as usize * CELL_PIXELS)?;
                (ReadyLight::Streams(Box::new(streams)), (n / CELL_PIXELS) as u32)
            }
        };
        Ok(Self { light, guide, max_groups, has_components, has_first_light })
    }

    /// Whether AOVs are written.
    pub(super) fn has_guides(&self) -> bool {
        self.guide.is_some()
    }

    /// Takes the samples of `n` work-groups and waits for them.
    pub(super) fn run(&mut self, gpu: &Gpu, bindings: &[NamedBinding<'_>], n: u32) -> Result<(), GpuError> {
        let mut commands = gpu.commands();
        let groups = |kernel: &Kernel| kernel.groups(n * kernel.group_size());
        match &mut self.light {
            ReadyLight::Whole(kernel) => commands.dispatch(kernel, bindings, groups(kernel))?,
            ReadyLight::Streams(streams) => streams.record(&mut commands, bindings, n)?,
        }
        if let Some(guide) = &self.guide {
            commands.dispatch(guide, bindings, groups(guide))?;
        }
        block_on(commands.run())
    }

    /// Takes the rest of these samples, where [`Self::took`] finds that some are not done.
    pub(super) fn run_rest(&mut self, gpu: &Gpu, bindings: &[NamedBinding<'_>], n: u32) -> Result<(), GpuError> {
        let ReadyLight::Streams(streams) = &mut self.light else { return Ok(()) };
        let mut commands = gpu.commands();
        streams.record_rest(&mut commands, bindings, n)?;
        block_on(commands.run())
    }

    /// What is read beside the samples, for [`Self::took`].
    pub(super) fn beside(&mut self) -> Vec<(&Buffer<u32>, usize)> {
        match &mut self.light {
            ReadyLight::Whole(_) => vec![],
            ReadyLight::Streams(streams) => streams.beside(),
        }
    }

    /// How many rays of streams exact kernels traced, and whether all samples are done; from the words of [`Self::beside`].
    pub(super) fn took(&mut self, beside: &[u32]) -> (u64, bool) {
        match &mut self.light {
            ReadyLight::Whole(_) => (0, true),
            ReadyLight::Streams(streams) => streams.took(beside),
        }
    }
}

/// A sample: linear RGB and the number of rays, which is negative where the kernel gave up.
pub(super) type PackedSample = [f32; 4];

/// `BlockSum` of `shared/camera/film`, where the members are documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PackedSum {
    sum: [f32; 3],
    n_rays: u32,
    deviations: [f32; 3],
    counts: u32,
    unfinished: [u32; 2],
}

/// A pixel's samples of a block.
pub(super) struct Taken {
    /// The samples that the device finished.
    pub(super) pixel: Pixel,
    /// Their rays.
    pub(super) n_rays: u64,
    /// A bit for each sample of the block that the CPU must take.
    pub(super) unfinished: u64,
}

/// What a kernel keeps of a block of samples of a pixel.
pub(super) trait SampleRecord: Pod {
    /// The part of the kernels that keeps it.
    const FILM: choice::Film;

    /// The variable that kernels write.
    const BINDING: &'static str;

    /// Samples in a block, at most: a power of two.
    const MAX_BLOCK: u32;

    /// Records in memory at once, at most: 32 MiB or less.
    const MAX: usize;

    /// What the device found; `weight` returns the weight of a sample.
    fn taken(&self, block: Block, weight: impl Fn(u32) -> f32) -> Taken;
}

impl SampleRecord for PackedSample {
    const FILM: choice::Film = choice::Film::Samples;
    const BINDING: &'static str = "samples";
    const MAX_BLOCK: u32 = 1;
    const MAX: usize = 1 << 21;

    fn taken(&self, block: Block, weight: impl Fn(u32) -> f32) -> Taken {
        let [red, green, blue, rays] = *self;
        if rays < 0.0 {
            // The traversal of a ray was cut short, so the sample is unknown.
            return Taken { pixel: Pixel::default(), n_rays: 0, unfinished: 1 };
        }
        let n_rays = rays as u64;
        Taken { pixel: Pixel::weighted([red, green, blue], weight(block.first)), n_rays, unfinished: 0 }
    }
}

impl SampleRecord for PackedSum {
    const FILM: choice::Film = choice::Film::Sums;
    const BINDING: &'static str = "sums";
    /// The invocations of a work-group.
    const MAX_BLOCK: u32 = 64;
    const MAX: usize = 1 << 19;

    fn taken(&self, _: Block, _: impl Fn(u32) -> f32) -> Taken {
        let Self { sum, n_rays, deviations, counts, unfinished: [low, high] } = *self;
        let counts = [0, 8, 16].map(|shift| counts >> shift & 0xff);
        Taken {
            pixel: Pixel::of_sums(sum.map(f64::from), deviations.map(f64::from), counts),
            n_rays: n_rays.into(),
            unfinished: u64::from(high) << 32 | u64::from(low),
        }
    }
}

/// The part of the kernels for these sums.
pub(super) fn film(sums: SampleSums) -> choice::Film {
    match sums {
        SampleSums::Host => PackedSample::FILM,
        SampleSums::Device => PackedSum::FILM,
    }
}

/// The part of the kernels that keeps the parts of the light, if they are requested.
pub(super) fn components(aovs: Aovs) -> choice::Components {
    if aovs.has_components() { choice::Components::Three } else { choice::Components::None }
}

/// The part of the kernel of `hybrid` that keeps the light at the first surface, if it is requested.
pub(super) fn first_light(aovs: Aovs) -> choice::FirstLight {
    if aovs.has_factors() { choice::FirstLight::Four } else { choice::FirstLight::None }
}

/// How many records of `R` a binding holds.
pub(super) fn n_records<R: SampleRecord>(gpu: &Gpu) -> usize {
    let limit = gpu.limits().max_storage_buffer_binding_size / size_of::<R>() as u64;
    R::MAX.min(usize::try_from(limit).unwrap_or(usize::MAX))
}

/// Samples that all cells take in the same dispatches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SampleRun {
    /// The first sample.
    pub(super) first: u32,
    /// Samples per pixel.
    pub(super) n: u32,
    /// Samples per block, which divide both.
    pub(super) block: u32,
}

impl SampleRun {
    /// The fewest runs of the samples `first..end` in blocks of at most `max_block` samples, in order. The blocks are those whose
    /// sums a film keeps, or halves of them, so they do not depend on tiles or dispatches.
    pub(super) fn all([first, end]: [u32; 2], max_block: u32) -> Vec<Self> {
        let mut runs: Vec<Self> = Vec::new();
        for Block { first, len } in Block::of(first..end) {
            let block = len.min(max_block);
            match runs.last_mut() {
                Some(last) if last.block == block => last.n += len,
                _ => runs.push(Self { first, n: len, block }),
            }
        }
        runs
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn runs_cover_all_samples_once() {
        let run = |first, n, block| SampleRun { first, n, block };
        assert_eq!(SampleRun::all([0, 100], 1), [run(0, 100, 1)]);
        assert_eq!(SampleRun::all([0, 64], 64), [run(0, 64, 64)]);
        assert_eq!(SampleRun::all([0, 1000], 64), [run(0, 960, 64), run(960, 32, 32), run(992, 8, 8)]);
        assert_eq!(SampleRun::all([3, 9], 64), [run(3, 1, 1), run(4, 4, 4), run(8, 1, 1)]);
        for first in 0..70 {
            for end in first..140 {
                let mut next = first;
                for SampleRun { first, n, block } in SampleRun::all([first, end], 16) {
                    assert_eq!(first, next);
                    assert!(block.is_power_of_two() && block <= 16 && n % block == 0 && first % block == 0);
                    next += n;
                }
                assert_eq!(next, end);
            }
        }
    }

    #[test]
    fn unfinished_and_dropped_samples_are_not_summed() {
        let block = Block { first: 64, len: 64 };
        let record = PackedSum {
            sum: [6.0, 0.0, 3.0],
            n_rays: 70,
            deviations: [2.0, 0.0, 0.5],
            counts: 2 | 1 << 8 | 3 << 16,
            unfinished: [1, 1 << 31],
        };
        let Taken { pixel, n_rays, unfinished } = record.taken(block, |_| 1.0);
        assert_eq!(pixel, Pixel::of_sums([6.0, 0.0, 3.0], [2.0, 0.0, 0.5], [2, 1, 3]));
        assert_eq!((n_rays, unfinished), (70, 1 << 63 | 1));
        let lost = [0.0, 0.0, 0.0, -1.0].taken(Block { first: 5, len: 1 }, |_| 1.0);
        assert_eq!((lost.pixel, lost.n_rays, lost.unfinished), (Pixel::default(), 0, 1));
        let sample =
            [1.0, 2.0, 4.0, 7.0].taken(Block { first: 5, len: 1 }, |sample| if sample == 5 { -1.0 } else { 1.0 });
        assert_eq!((sample.pixel, sample.n_rays), (Pixel::weighted([1.0, 2.0, 4.0], -1.0), 7));
    }
}
