//! Samples that the device sums: one record a pixel comes back, for any number of samples.
//!
//! ```text
//! reads   the samples of dispatches, cell by cell
//! writes  the sums of all samples of each pixel
//! holds   they have the bits of sums on the host
//! source  shaders/render/sum.wgsl
//! ```

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_film::{Block, Pixel};
use canted_gpu::{Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding, Variant, wgsl};

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

/// `SampleSum` of `render/sum`, where the members are documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct PackedSum {
    sum: [f64; 3],
    sum_of_squares: [f64; 3],
    n_negative: u32,
    n_dropped: u32,
    pub(super) n_rays: u64,
}

impl PackedSum {
    /// The sums of `n` samples.
    pub(super) fn pixel(&self, n: u32) -> Pixel {
        let Self { sum, sum_of_squares, n_negative, n_dropped, .. } = *self;
        Pixel { sum, sum_of_squares, n_samples: n - n_dropped, n_negative, n_dropped }
    }
}

/// A sample that the CPU took, as kernels keep it; of one that is dropped, only that its light is not finite.
pub(super) fn packed(pixel: &Pixel, n_rays: u64) -> PackedSample {
    let light = match [pixel.n_dropped, pixel.n_negative] {
        [0, 0] => pixel.sum,
        [0, _] => pixel.sum.map(|x| -x),
        _ => [f64::INFINITY; 3],
    };
    // Exact: light is that of an f32, and a sample has fewer rays than 2^24.
    let [red, green, blue] = light.map(|x| x as f32);
    [red, green, blue, n_rays as f32]
}

/// Compiled kernels.
#[derive(Clone)]
pub(super) struct SumKernels {
    blocks: Arc<Kernel>,
    pixels: Arc<Kernel>,
}

impl SumKernels {
    /// Those of a picture; `chosen` has the choices of its other kernels.
    pub(super) fn new(gpu: &Gpu, chosen: &Variant) -> Result<Self, GpuError> {
        use wgsl::render::sum;
        let wanted = [sum::BLOCKS, sum::PIXELS].map(|name| Ok::<_, GpuError>((name, chosen.of_kernel(name)?)));
        let [blocks, pixels] = wanted;
        let compiled = gpu.kernels(&[blocks?, pixels?])?;
        let [blocks, pixels] = &compiled[..] else { unreachable!("a kernel for each name") };
        Ok(Self { blocks: blocks.clone(), pixels: pixels.clone() })
    }
}

/// Most bytes of the sums of blocks that wait for other samples.
const MOST_WAITING: u64 = 64 << 20;

/// Kernels with their buffers.
pub(super) struct DeviceSums {
    kernels: SumKernels,
    /// Samples of a dispatch that no kernel finished.
    pub(super) n_unfinished: Buffer<u32>,
    blocks: Buffer<PackedSum>,
    waiting: Buffer<PackedSum>,
    /// One per pixel of the cells that are summed together.
    pub(super) sums: Buffer<PackedSum>,
}

impl DeviceSums {
    /// For dispatches of at most so many work-groups, which take so many samples of a pixel.
    pub(super) fn new(gpu: &Gpu, kernels: SumKernels, (n_groups, n_samples): (u32, u32)) -> Result<Self, GpuError> {
        let n_levels = n_samples.max(1).ilog2() as usize + 1;
        let most = gpu.limits().max_storage_buffer_binding_size.min(MOST_WAITING);
        let of_cell = (CELL_PIXELS * n_levels * size_of::<PackedSum>()) as u64;
        let n_cells = (most / of_cell).clamp(1, n_groups.max(1).into()) as usize;
        Ok(Self {
            kernels,
            n_unfinished: gpu.work_buffer("unfinished samples", 1)?,
            blocks: gpu.work_buffer("sums of blocks", n_groups as usize)?,
            waiting: gpu.work_buffer("waiting sums", n_cells * CELL_PIXELS * n_levels)?,
            sums: gpu.work_buffer("sums of samples", n_cells * CELL_PIXELS)?,
        })
    }

    /// Most cells that are summed together.
    pub(super) fn n_cells(&self) -> usize {
        self.sums.len() / CELL_PIXELS
    }

    /// Adds the dispatches that add the samples of so many work-groups and cells.
    pub(super) fn record(
        &self,
        commands: &mut Commands<'_>,
        bindings: &[NamedBinding<'_>],
        [n_groups, n_cells]: [u32; 2],
    ) -> Result<(), GpuError> {
        let SumKernels { blocks, pixels } = &self.kernels;
        let own: [NamedBinding<'_>; 4] = [
            ("n_unfinished", &self.n_unfinished),
            ("blocks", &self.blocks),
            ("waiting", &self.waiting),
            ("sums", &self.sums),
        ];
        let bindings = [bindings, &own].concat();
        commands.clear(&self.n_unfinished);
        commands.dispatch(blocks, &bindings, blocks.groups(n_groups * blocks.group_size()))?;
        commands.dispatch(pixels, &bindings, pixels.groups(n_cells * pixels.group_size()))
    }
}
