//! Dispatches the samples of cells, about 100 ms at a time.

use std::time::{Duration, Instant};

use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding};

use super::kernels::{CELL_PIXELS, PackedGuide, ReadyKernels, RenderKernels};
use super::picture::Slice;
use super::records::{SampleRecord, SampleRun, n_records};

/// Target time of a dispatch: short enough for a display that waits for it, long compared with the cost of starting one.
const TARGET: Duration = Duration::from_millis(100);

/// Work-groups of the first dispatch, before the speed of the device is known.
const FIRST: u32 = 64;

/// Maximum work-groups of a dispatch: 32 MiB of samples, if each is kept.
const MAX: u32 = 1 << 15;

/// Takes samples of cells on a GPU, and returns records of them.
pub(super) struct SampleDispatcher<'a, R> {
    gpu: &'a Gpu,
    kernels: ReadyKernels,
    slice: Buffer<Slice>,
    records: Buffer<R>,
    /// AOVs of each sample, where they are requested.
    guides: Option<Buffer<PackedGuide>>,
    /// Work-groups of the next dispatch.
    n_groups: u32,
}

impl<'a, R: SampleRecord> SampleDispatcher<'a, R> {
    pub(super) fn new(gpu: &'a Gpu, kernels: RenderKernels) -> Result<Self, GpuError> {
        let slice = Slice { first_group: 0, end_group: 0, first_sample: 0, n_samples: 1, block: 1 };
        let slice = gpu.uniform("slice", &slice)?;
        let kernels = ReadyKernels::new(gpu, kernels, MAX);
        let n = kernels.max_groups;
        let records = gpu.zeroed(R::BINDING, n_records::<R>(gpu).min(n as usize * CELL_PIXELS))?;
        let guides = kernels.has_guides().then(|| gpu.zeroed("guides", n as usize * CELL_PIXELS)).transpose()?;
        Ok(Self { gpu, kernels, slice, records, guides, n_groups: FIRST.min(n) })
    }

    /// Cells that fill a dispatch if each takes `n_samples` samples.
    pub(super) fn n_cells(&self, n_samples: u32) -> usize {
        self.n_groups.div_ceil(n_samples.max(1)) as usize
    }

    /// Takes the samples of a run of each cell.
    ///
    /// `each` receives the records of 64 pixels at a time, for one block of samples, and the AOVs of these samples if requested,
    /// pixel by pixel; cell by cell in the order of blocks. It stops the work by returning false.
    ///
    /// # Errors
    /// Errors of the device.
    pub(super) fn take(
        &mut self,
        cells: &[u32],
        run: SampleRun,
        bindings: &[NamedBinding<'_>],
        mut each: impl FnMut(&[R], &[PackedGuide]) -> bool,
    ) -> Result<(), GpuError> {
        let SampleRun { first: first_sample, n: n_samples, block } = run;
        let all = cells.len() as u64 * u64::from(n_samples);
        let mut done = 0;
        // A dispatch may end between the pixels of a cell.
        let (mut taken, mut guides) = (Vec::new(), Vec::new());
        while done < all {
            // In windows of whole cells, so that work-groups are counted in 32 bits.
            let (cell, start_group) = ((done / u64::from(n_samples)) as usize, (done % u64::from(n_samples)) as u32);
            let n = u64::from(self.n_groups).min(self.max_groups(block)).min(all - done);
            let end_group = start_group + n as u32;
            let window = &cells[cell..(cell + end_group.div_ceil(n_samples) as usize)];
            let slice = Slice { first_group: start_group, end_group, first_sample, n_samples, block };
            self.dispatch(window, slice, bindings, &mut taken, &mut guides)?;
            done += n;
            let mut of_samples = guides.chunks_exact(CELL_PIXELS * block as usize);
            let whole = taken.chunks_exact(CELL_PIXELS);
            let n_whole = whole.len();
            if !whole.into_iter().all(|taken| each(taken, of_samples.next().unwrap_or_default())) {
                return Ok(());
            }
            taken.drain(..n_whole * CELL_PIXELS);
            guides.drain(..guides.len().min(n_whole * CELL_PIXELS * block as usize));
        }
        Ok(())
    }

    /// Work-groups whose records fit in memory.
    fn max_groups(&self, block: u32) -> u64 {
        (self.records.len() as u64 * u64::from(block) / CELL_PIXELS as u64).min(self.kernels.max_groups.into())
    }

    /// Appends the records and AOVs of a dispatch.
    fn dispatch(
        &mut self,
        cells: &[u32],
        slice: Slice,
        bindings: &[NamedBinding<'_>],
        taken: &mut Vec<R>,
        guides: &mut Vec<PackedGuide>,
    ) -> Result<(), GpuError> {
        let start = Instant::now();
        let n = slice.end_group - slice.first_group;
        let cells = self.gpu.buffer("cells", cells)?;
        self.gpu.write(&self.slice, &[slice]);
        let own: [NamedBinding<'_>; 3] = [("slice", &self.slice), ("cells", &cells), (R::BINDING, &self.records)];
        let guide_binding = self.guides.as_ref().map(|guides| -> NamedBinding<'_> { ("guides", guides) });
        let bindings: Vec<NamedBinding<'_>> =
            own.into_iter().chain(guide_binding).chain(bindings.iter().copied()).collect();
        self.kernels.run(self.gpu, &bindings, n)?;
        let time = start.elapsed();
        let n_samples = n as usize * CELL_PIXELS;
        taken.extend(self.gpu.read_first(&self.records, n_samples / slice.block as usize)?);
        if let Some(of_samples) = &self.guides {
            guides.extend(self.gpu.read_first(of_samples, n_samples)?);
        }
        self.n_groups = next_size([n, self.n_groups], time, self.kernels.max_groups);
        Ok(())
    }
}

/// Work-groups of the dispatch after one of `n` that took `time`, at most `max`. A dispatch that was smaller than `planned`, because
/// no more was left, and was quick is no reason for fewer.
fn next_size([n, planned]: [u32; 2], time: Duration, max: u32) -> u32 {
    let share = TARGET.as_secs_f64() / time.as_secs_f64().max(1e-6);
    // The first dispatch includes compilation, so the size changes by limited factors.
    let next = (f64::from(n) * share.clamp(0.25, 4.0)).clamp(1.0, f64::from(max)) as u32;
    if n < planned && time <= TARGET { next.max(planned) } else { next }
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
                n = next_size([n, n], Duration::from_secs_f64(1e-6 * micros), MAX);
            }
            let time = Duration::from_secs_f64(1e-6 * f64::from(n) * of_group);
            assert!(time <= TARGET || n == 1, "{n} groups of {of_group} us take {time:?}");
            assert!(2 * time >= TARGET || n == MAX, "{n} groups of {of_group} us take {time:?}");
        }
    }

    #[test]
    fn no_dispatch_exceeds_the_maximum() {
        assert_eq!(next_size([100, 100], Duration::ZERO, 128), 128);
        assert_eq!(next_size([1, 1], Duration::from_secs(10), 128), 1);
    }

    #[test]
    fn a_short_last_dispatch_keeps_the_size() {
        assert_eq!(next_size([2, 100], TARGET / 100, 128), 100);
        assert_eq!(next_size([50, 100], TARGET / 4, 128), 128);
        assert_eq!(next_size([50, 100], 2 * TARGET, 128), 25);
    }
}
