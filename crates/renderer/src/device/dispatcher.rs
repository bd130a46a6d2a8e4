//! Dispatches the samples of cells, about 100 ms at a time.

use std::time::{Duration, Instant};

use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding};

use super::kernels::{CELL_PIXELS, PackedGuide, PackedSample, ReadyKernels, RenderKernels};
use super::picture::Slice;

/// Target time of a dispatch: short enough for a display that waits for it, long compared with the cost of starting one.
const TARGET: Duration = Duration::from_millis(100);

/// Work-groups of the first dispatch, before the speed of the device is known.
const FIRST: u32 = 64;

/// Maximum work-groups of a dispatch: 32 MiB of samples.
const MAX: u32 = 1 << 15;

/// Takes samples of cells on a GPU.
pub(super) struct SampleDispatcher<'a> {
    gpu: &'a Gpu,
    kernels: ReadyKernels,
    slice: Buffer<Slice>,
    samples: Buffer<PackedSample>,
    /// AOVs, where they are requested.
    guides: Option<Buffer<PackedGuide>>,
    /// Work-groups of the next dispatch.
    n_groups: u32,
}

impl<'a> SampleDispatcher<'a> {
    pub(super) fn new(gpu: &'a Gpu, kernels: RenderKernels) -> Result<Self, GpuError> {
        let slice = gpu.uniform("slice", &Slice { first_group: 0, end_group: 0, first_sample: 0, n_samples: 1 })?;
        let kernels = ReadyKernels::new(gpu, kernels, MAX)?;
        let n = kernels.max_groups;
        let samples = gpu.zeroed("samples", n as usize * CELL_PIXELS)?;
        let guides = kernels.has_guides().then(|| gpu.zeroed("guides", n as usize * CELL_PIXELS)).transpose()?;
        Ok(Self { gpu, kernels, slice, samples, guides, n_groups: FIRST.min(n) })
    }

    /// Cells that fill a dispatch if each takes `n_samples` samples.
    pub(super) fn n_cells(&self, n_samples: u32) -> usize {
        self.n_groups.div_ceil(n_samples.max(1)) as usize
    }

    /// Takes samples `first_sample..first_sample + n_samples` of each cell.
    ///
    /// `each` receives one sample of 64 pixels at a time, and their AOVs if requested, cell by cell in the order of sample
    /// numbers; it stops the work by returning false.
    ///
    /// # Errors
    /// Errors of the device.
    pub(super) fn take(
        &mut self,
        cells: &[u32],
        [first_sample, n_samples]: [u32; 2],
        bindings: &[NamedBinding<'_>],
        mut each: impl FnMut(&[PackedSample], &[PackedGuide]) -> bool,
    ) -> Result<(), GpuError> {
        let all = cells.len() as u64 * u64::from(n_samples);
        let mut done = 0;
        while done < all {
            // In windows of whole cells, so that work-groups are counted in 32 bits.
            #[expect(clippy::cast_possible_truncation, reason = "quotient and remainder by a u32 of what cells number")]
            let (cell, start_group) = ((done / u64::from(n_samples)) as usize, (done % u64::from(n_samples)) as u32);
            let n = u64::from(self.n_groups).min(all - done);
            #[expect(clippy::cast_possible_truncation, reason = "at most n_groups")]
            let end_group = start_group + n as u32;
            let window = &cells[cell..(cell + end_group.div_ceil(n_samples) as usize)];
            let slice = Slice { first_group: start_group, end_group, first_sample, n_samples };
            let (taken, guides) = self.dispatch(window, slice, bindings)?;
            done += n;
            let guides = guides.chunks_exact(CELL_PIXELS).chain(std::iter::repeat(&[][..]));
            if !taken.chunks_exact(CELL_PIXELS).zip(guides).all(|(taken, guides)| each(taken, guides)) {
                return Ok(());
            }
        }
        Ok(())
    }

    fn dispatch(
        &mut self,
        cells: &[u32],
        slice: Slice,
        bindings: &[NamedBinding<'_>],
    ) -> Result<(Vec<PackedSample>, Vec<PackedGuide>), GpuError> {
        let start = Instant::now();
        let n = slice.end_group - slice.first_group;
        let cells = self.gpu.buffer("cells", cells)?;
        self.gpu.write(&self.slice, &[slice]);
        let own: [NamedBinding<'_>; 3] = [("slice", &self.slice), ("cells", &cells), ("samples", &self.samples)];
        let guide_binding = self.guides.as_ref().map(|guides| -> NamedBinding<'_> { ("guides", guides) });
        let bindings: Vec<NamedBinding<'_>> =
            own.into_iter().chain(guide_binding).chain(bindings.iter().copied()).collect();
        self.kernels.run(self.gpu, &bindings, n)?;
        let time = start.elapsed();
        let n_pixels = n as usize * CELL_PIXELS;
        let taken = self.gpu.read_first(&self.samples, n_pixels)?;
        let guides = self.guides.as_ref().map_or(Ok(vec![]), |guides| self.gpu.read_first(guides, n_pixels))?;
        self.n_groups = next_size(n, time, self.samples.len() / CELL_PIXELS);
        Ok((taken, guides))
    }
}

/// Work-groups of the dispatch after one of `n` that took `time`, at most `max`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the maximum")]
fn next_size(n: u32, time: Duration, max: usize) -> u32 {
    let share = TARGET.as_secs_f64() / time.as_secs_f64().max(1e-6);
    // The first dispatch includes compilation, so the size changes by limited factors.
    (f64::from(n) * share.clamp(0.25, 4.0)).clamp(1.0, max as f64) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dispatches_approach_the_target_time() {
        // Microseconds per group, and 50 ms more for the first dispatch, which compiles.
        for of_group in [1.0, 40.0, 3_000.0, 60_000.0, 400_000.0] {
            let mut n = FIRST;
            for turn in 0..20 {
                let micros = f64::from(n) * of_group + if turn == 0 { 50e3 } else { 0.0 };
                n = next_size(n, Duration::from_secs_f64(1e-6 * micros), MAX as usize);
            }
            let time = Duration::from_secs_f64(1e-6 * f64::from(n) * of_group);
            assert!(time <= TARGET || n == 1, "{n} groups of {of_group} us take {time:?}");
            assert!(2 * time >= TARGET || n == MAX, "{n} groups of {of_group} us take {time:?}");
        }
    }

    #[test]
    fn no_dispatch_exceeds_the_maximum() {
        assert_eq!(next_size(100, Duration::ZERO, 128), 128);
        assert_eq!(next_size(1, Duration::from_secs(10), 128), 1);
    }
}
