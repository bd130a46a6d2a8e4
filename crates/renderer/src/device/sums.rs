//! Samples that the device sums: one record a pixel comes back, for any number of samples.
//!
//! ```text
//! reads   what kernels keep of the samples of dispatches, cell by cell
//! writes  the sums of all samples of each pixel
//! holds   they have the bits of sums on the host
//! source  shaders/render/sum.wgsl
//! ```

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_film::{Aovs, Block, Components, Guide, Pixel, Sums};
use canted_gpu::{Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding, Variant, block_on, choice, wgsl};

use super::picture::CELL_PIXELS;

/// A sample: linear RGB and the number of rays, which is negative where the kernel gave up.
pub(super) type PackedSample = [f32; 4];

/// Samples that all cells take one after the other.
pub(super) type SampleRun = Range<u32>;

/// Runs of the samples of a range: one, or one for each block whose sum a film keeps.
pub(super) fn runs(samples: SampleRun, is_one: bool) -> Vec<SampleRun> {
    if is_one {
        return vec![samples];
    }
    Block::of(samples).into_iter().map(|Block { first, len }| first..first + len).collect()
}

/// `SampleSum` of `summed/light`, where the members are documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct PackedSum {
    sum: [f64; 3],
    sum_of_squares: [f64; 3],
    n_negative: u32,
    n_dropped: u32,
    n_rays: u64,
}

impl PackedSum {
    /// The sums of `n` samples.
    fn pixel(&self, n: u32) -> Pixel {
        let Self { sum, sum_of_squares, n_negative, n_dropped, .. } = *self;
        Pixel { sum, sum_of_squares, n_samples: n - n_dropped, n_negative, n_dropped }
    }
}

/// `SampleSum` of `summed/guide`, where the members are documented: the sums of `PackedGuide`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct PackedGuideSum {
    normal: [f64; 3],
    depth: f64,
    shading_normal: [f64; 3],
    n_boxes: f64,
    albedo: [f64; 3],
    n_triangles: f64,
    n_hits: u32,
    /// Instance and primitive.
    first: [u32; 2],
    padding: u32,
}

impl From<&PackedGuideSum> for Guide {
    fn from(sum: &PackedGuideSum) -> Self {
        let PackedGuideSum { normal, depth, shading_normal, n_boxes, albedo, n_triangles, n_hits, first, .. } = *sum;
        let first = (first[0] != u32::MAX).then_some(first);
        Self { n_hits, first, depth, normal, shading_normal, albedo, tests: [n_boxes, n_triangles] }
    }
}

/// `SampleSum` of `summed/components` and of `summed/first_light`: linear RGB of each part.
pub(super) type PackedParts<const N: usize> = [[f64; 3]; N];

/// Compiled kernels.
#[derive(Clone)]
pub(super) struct SumKernels {
    light: BlocksAndPixels,
    guides: Option<BlocksAndPixels>,
    components: Option<BlocksAndPixels>,
    first_light: Option<BlocksAndPixels>,
}

/// The kernels that sum one thing of each sample, in their order.
type BlocksAndPixels = [Arc<Kernel>; 2];

impl SumKernels {
    /// Those of a picture with these AOVs; `chosen` has the choices of its other kernels.
    pub(super) fn new(gpu: &Gpu, chosen: &Variant, aovs: Aovs) -> Result<Self, GpuError> {
        use choice::Summed;
        use wgsl::render::sum;
        let kernels = |summed: Summed| -> Result<BlocksAndPixels, GpuError> {
            let chosen = chosen.clone().with(summed);
            let [blocks, pixels] =
                [sum::BLOCKS, sum::PIXELS].map(|name| Ok::<_, GpuError>((name, chosen.of_kernel(name)?)));
            let [blocks, pixels] = &gpu.kernels(&[blocks?, pixels?])?[..] else {
                unreachable!("a kernel for each name")
            };
            Ok([blocks.clone(), pixels.clone()])
        };
        let wanted = |summed: Summed, is_wanted: bool| is_wanted.then(|| kernels(summed)).transpose();
        Ok(Self {
            light: kernels(Summed::Light)?,
            guides: wanted(Summed::Guide, !aovs.is_empty())?,
            components: wanted(Summed::Components, aovs.has_components())?,
            first_light: wanted(Summed::FirstLight, aovs.has_factors())?,
        })
    }
}

/// Most bytes of the sums of one thing, of blocks that wait for other samples. Pictures of more cells are summed one part after the other.
const MOST_WAITING: u64 = 64 << 20;

/// Kernels with their buffers.
pub(super) struct DeviceSums {
    /// Samples of a dispatch that no kernel finished.
    pub(super) n_unfinished: Buffer<u32>,
    pub(super) light: ReadySums<PackedSum>,
    guides: Option<ReadySums<PackedGuideSum>>,
    components: Option<ReadySums<PackedParts<3>>>,
    first_light: Option<ReadySums<PackedParts<4>>>,
}

/// Kernels that sum one thing of each sample, with their buffers.
pub(super) struct ReadySums<T> {
    kernels: BlocksAndPixels,
    blocks: Buffer<T>,
    waiting: Buffer<T>,
    /// One per pixel of the cells that are summed together.
    pub(super) sums: Buffer<T>,
}

/// The sums of the device, pixel by pixel; empty where they are not requested.
#[derive(Default)]
pub(super) struct PixelSums {
    pub(super) light: Vec<PackedSum>,
    guides: Vec<PackedGuideSum>,
    components: Vec<PackedParts<3>>,
    first_light: Vec<PackedParts<4>>,
}

impl PixelSums {
    /// Adds the sums of a pixel over the samples of a run. Returns the number of rays.
    pub(super) fn add_to(&self, sums: &mut Sums, pixel: usize, run: &SampleRun) -> u64 {
        let light = &self.light[pixel];
        sums.pixel.push_sum(run.clone(), light.pixel(run.end - run.start));
        if let Some(guide) = self.guides.get(pixel) {
            sums.guide.push_sum(run.clone(), guide.into());
        }
        if let Some(&parts) = self.components.get(pixel) {
            let first = self.first_light.get(pixel).copied();
            sums.components.push_sum(run.clone(), Components { sums: parts, first });
        }
        light.n_rays
    }
}

impl DeviceSums {
    /// For dispatches of at most so many work-groups, of at most so many cells, which take so many samples of a pixel.
    pub(super) fn new(
        gpu: &Gpu,
        kernels: SumKernels,
        [n_groups, n_cells, n_samples]: [u32; 3],
    ) -> Result<Self, GpuError> {
        let SumKernels { light, guides, components, first_light } = kernels;
        let n_levels = n_samples.max(1).ilog2() as usize + 1;
        let most = gpu.limits().max_storage_buffer_binding_size.min(MOST_WAITING);
        let of_pixel = if guides.is_some() { size_of::<PackedGuideSum>() } else { size_of::<PackedSum>() };
        let of_cell = (CELL_PIXELS * n_levels * of_pixel) as u64;
        let n_cells = (most / of_cell).clamp(1, n_groups.min(n_cells).max(1).into()) as usize;
        let size = (n_groups as usize, n_cells, n_levels);
        Ok(Self {
            n_unfinished: gpu.work_buffer("unfinished samples", 1)?,
            light: ReadySums::new(gpu, light, size)?,
            guides: guides.map(|kernels| ReadySums::new(gpu, kernels, size)).transpose()?,
            components: components.map(|kernels| ReadySums::new(gpu, kernels, size)).transpose()?,
            first_light: first_light.map(|kernels| ReadySums::new(gpu, kernels, size)).transpose()?,
        })
    }

    /// Most cells that are summed together.
    pub(super) fn n_cells(&self) -> usize {
        self.light.sums.len() / CELL_PIXELS
    }

    /// Adds the dispatches that add the samples of so many work-groups and cells.
    pub(super) fn record(
        &self,
        commands: &mut Commands<'_>,
        bindings: &[NamedBinding<'_>],
        size: [u32; 2],
    ) -> Result<(), GpuError> {
        let Self { n_unfinished, light, guides, components, first_light } = self;
        commands.clear(n_unfinished);
        let bindings = [bindings, &[("n_unfinished", n_unfinished)]].concat();
        // No pixel is summed before all unfinished samples are counted.
        for step in 0..2 {
            light.record(commands, &bindings, size, step)?;
            if let Some(guides) = guides {
                guides.record(commands, &bindings, size, step)?;
            }
            if let Some(components) = components {
                components.record(commands, &bindings, size, step)?;
            }
            if let Some(first_light) = first_light {
                first_light.record(commands, &bindings, size, step)?;
            }
        }
        Ok(())
    }

    /// The sums of so many pixels; those of the light are here.
    pub(super) fn read(&self, gpu: &Gpu, light: Vec<PackedSum>, n: usize) -> Result<PixelSums, GpuError> {
        Ok(PixelSums {
            light,
            guides: read(gpu, self.guides.as_ref().map(|guides| &guides.sums), n)?,
            components: read(gpu, self.components.as_ref().map(|components| &components.sums), n)?,
            first_light: read(gpu, self.first_light.as_ref().map(|first| &first.sums), n)?,
        })
    }
}

/// The first values of a buffer, if it is there.
pub(super) fn read<T: Pod>(gpu: &Gpu, buffer: Option<&Buffer<T>>, n: usize) -> Result<Vec<T>, GpuError> {
    buffer.map_or(Ok(vec![]), |buffer| block_on(gpu.read_first(buffer, n)))
}

impl<T: Pod> ReadySums<T> {
    /// For so many work-groups, cells and lengths of blocks.
    fn new(
        gpu: &Gpu,
        kernels: BlocksAndPixels,
        (n_groups, n_cells, n_levels): (usize, usize, usize),
    ) -> Result<Self, GpuError> {
        Ok(Self {
            kernels,
            blocks: gpu.work_buffer("sums of blocks", n_groups)?,
            waiting: gpu.work_buffer("waiting sums", n_cells * CELL_PIXELS * n_levels)?,
            sums: gpu.work_buffer("sums of samples", n_cells * CELL_PIXELS)?,
        })
    }

    /// Adds the dispatch of one of the kernels.
    fn record(
        &self,
        commands: &mut Commands<'_>,
        bindings: &[NamedBinding<'_>],
        size: [u32; 2],
        step: usize,
    ) -> Result<(), GpuError> {
        let Self { kernels, blocks, waiting, sums } = self;
        let own: [NamedBinding<'_>; 3] = [("blocks", blocks), ("waiting", waiting), ("sums", sums)];
        let kernel = &kernels[step];
        commands.dispatch(kernel, &[bindings, &own].concat(), kernel.groups(size[step] * kernel.group_size()))
    }
}
