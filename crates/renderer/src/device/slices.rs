//! Samples of cells, in dispatches of about 100 ms.

use std::time::{Duration, Instant};

use bytemuck::{Pod, Zeroable};
use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding};

use super::picture::Slice;
use super::stages::{Ready, Stages};

/// How long a dispatch should take: short enough for a display that waits behind it, long beside what starting one costs.
const WANTED: Duration = Duration::from_millis(100);

/// Pixels of a cell, and invocations of a work-group.
pub(super) const CELL_PIXELS: usize = 64;

/// Work-groups of the first dispatch, before anything is known of the device.
const FIRST: u32 = 64;

/// Most work-groups of a dispatch: 32 MiB of samples.
const MOST: u32 = 1 << 15;

/// A sample: linear RGB, and the number of rays traced for it.
pub(super) type Taken = [f32; 4];

/// `Guide` of `render/guide`: what a camera ray meets first.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Seen {
    pub(super) normal: [f32; 3],
    pub(super) depth: f32,
    pub(super) shading_normal: [f32; 3],
    pub(super) n_boxes: f32,
    pub(super) albedo: [f32; 3],
    pub(super) n_triangles: f32,
    /// `u32::MAX` for a miss.
    pub(super) primitive: u32,
    /// `u32::MAX` for a miss and for a light.
    pub(super) instance: u32,
    padding: [u32; 2],
}

/// Takes samples of cells on a device.
pub(super) struct Slicer<'a> {
    gpu: &'a Gpu,
    kernels: Ready,
    slice: Buffer<Slice>,
    samples: Buffer<Taken>,
    /// What camera rays meet, where that is asked for.
    guides: Option<Buffer<Seen>>,
    /// Work-groups of the next dispatch.
    n_groups: u32,
}

impl<'a> Slicer<'a> {
    pub(super) fn new(gpu: &'a Gpu, stages: Stages) -> Result<Self, GpuError> {
        let slice = gpu.uniform("slice", &Slice { first_group: 0, end_group: 0, first_sample: 0, n_samples: 1 })?;
        let kernels = Ready::new(gpu, stages, MOST)?;
        let n = kernels.most_groups;
        let samples = gpu.zeroed("samples", n as usize * CELL_PIXELS)?;
        let guides = kernels.is_guided().then(|| gpu.zeroed("guides", n as usize * CELL_PIXELS)).transpose()?;
        Ok(Self { gpu, kernels, slice, samples, guides, n_groups: FIRST.min(n) })
    }

    /// Cells that are worth being handed over at once where each takes `n_samples` samples.
    pub(super) fn worth(&self, n_samples: u32) -> usize {
        self.n_groups.div_ceil(n_samples.max(1)) as usize
    }

    /// Takes samples `first_sample..first_sample + n_samples` of each cell. `each` gets the samples of 64 pixels at a time, with
    /// what their camera rays meet where that is asked for, cell by cell and in the order of their numbers; it stops the work by
    /// returning false.
    ///
    /// # Errors
    /// What the device refuses, or its loss.
    pub(super) fn take(
        &mut self,
        cells: &[u32],
        [first_sample, n_samples]: [u32; 2],
        bound: &[NamedBinding<'_>],
        mut each: impl FnMut(&[Taken], &[Seen]) -> bool,
    ) -> Result<(), GpuError> {
        let all = cells.len() as u64 * u64::from(n_samples);
        let mut done = 0;
        while done < all {
            // In windows of whole cells, so that work-groups are counted in 32 bits.
            #[expect(clippy::cast_possible_truncation, reason = "quotient and remainder by a u32 of what cells number")]
            let (cell, begun) = ((done / u64::from(n_samples)) as usize, (done % u64::from(n_samples)) as u32);
            let n = u64::from(self.n_groups).min(all - done);
            #[expect(clippy::cast_possible_truncation, reason = "at most n_groups")]
            let end_group = begun + n as u32;
            let window = &cells[cell..(cell + end_group.div_ceil(n_samples) as usize)];
            let slice = Slice { first_group: begun, end_group, first_sample, n_samples };
            let (taken, seen) = self.dispatch(window, slice, bound)?;
            done += n;
            let seen = seen.chunks_exact(CELL_PIXELS).chain(std::iter::repeat(&[][..]));
            if !taken.chunks_exact(CELL_PIXELS).zip(seen).all(|(taken, seen)| each(taken, seen)) {
                return Ok(());
            }
        }
        Ok(())
    }

    fn dispatch(
        &mut self,
        cells: &[u32],
        slice: Slice,
        bound: &[NamedBinding<'_>],
    ) -> Result<(Vec<Taken>, Vec<Seen>), GpuError> {
        let start = Instant::now();
        let n = slice.end_group - slice.first_group;
        let cells = self.gpu.buffer("cells", cells)?;
        self.gpu.write(&self.slice, &[slice]);
        let own: [NamedBinding<'_>; 3] = [("slice", &self.slice), ("cells", &cells), ("samples", &self.samples)];
        let guides = self.guides.as_ref().map(|guides| -> NamedBinding<'_> { ("guides", guides) });
        let bound: Vec<NamedBinding<'_>> = own.into_iter().chain(guides).chain(bound.iter().copied()).collect();
        self.kernels.run(self.gpu, &bound, n)?;
        let time = start.elapsed();
        let n_pixels = n as usize * CELL_PIXELS;
        let taken = self.gpu.read_first(&self.samples, n_pixels)?;
        let seen = self.guides.as_ref().map_or(Ok(vec![]), |guides| self.gpu.read_first(guides, n_pixels))?;
        self.n_groups = next_size(n, time, self.samples.len() / CELL_PIXELS);
        Ok((taken, seen))
    }
}

/// Work-groups of the dispatch after one of `n` that took `time`, where there is room for the samples of `room`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the room for samples")]
fn next_size(n: u32, time: Duration, room: usize) -> u32 {
    let share = WANTED.as_secs_f64() / time.as_secs_f64().max(1e-6);
    // The first dispatch compiles too, so one measurement must not say all.
    (f64::from(n) * share.clamp(0.25, 4.0)).clamp(1.0, room as f64) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dispatches_come_near_to_the_time_wanted() {
        // A device that takes a group in so many microseconds, and 50 ms more at first, to compile.
        for of_group in [1.0, 40.0, 3_000.0, 60_000.0, 400_000.0] {
            let mut n = FIRST;
            for turn in 0..20 {
                let micros = f64::from(n) * of_group + if turn == 0 { 50e3 } else { 0.0 };
                n = next_size(n, Duration::from_secs_f64(1e-6 * micros), MOST as usize);
            }
            let time = Duration::from_secs_f64(1e-6 * f64::from(n) * of_group);
            assert!(time <= WANTED || n == 1, "{n} groups of {of_group} us take {time:?}");
            assert!(2 * time >= WANTED || n == MOST, "{n} groups of {of_group} us take {time:?}");
        }
    }

    #[test]
    fn no_dispatch_has_more_than_there_is_room_for() {
        assert_eq!(next_size(100, Duration::ZERO, 128), 128);
        assert_eq!(next_size(1, Duration::from_secs(10), 128), 1);
    }
}
