//! Takes samples on a GPU, about 100 ms at a time, and collects them into tiles.

use std::sync::Arc;
use std::time::{Duration, Instant};

use canted_film::{Aovs, CELL, Sums, Tile, Tiling};
use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding, TracedScene, block_on};

use super::picture::{CELL_PIXELS, Pace, Slice};
use super::records::{ReadyKernels, Records, RenderKernels, Samples, Took};
use super::sums::{PixelSums, SampleRun, runs};
use crate::render::{Adaptive, RenderTiles};
use crate::{RenderError, Settings};

/// Target time of a dispatch: short enough for a display that waits for it, long compared with the cost of starting one.
const TARGET: Duration = Duration::from_millis(100);

/// Work-groups of the first dispatch, before the speed of the device is known.
const FIRST: u32 = 64;

/// Maximum work-groups of a dispatch: 32 MiB of samples, eight times as many invocations as the largest devices run at once.
const MAX: u32 = 1 << 15;

/// Work-groups of a dispatch with which a device still makes progress.
const FEW: u32 = 64;

/// Takes samples of cells on a GPU.
pub(super) struct SampleDispatcher<'a> {
    gpu: &'a Gpu,
    kernels: ReadyKernels,
    slice: Buffer<Slice>,
    records: Records,
    /// Most work-groups of a dispatch, and those of the next one.
    max_groups: u32,
    n_groups: u32,
    pace: Arc<Pace>,
    /// Rays of streams that exact kernels traced.
    pub(super) n_exact_rays: u64,
}

impl<'a> SampleDispatcher<'a> {
    /// For `n_groups` work-groups in all, which take `n_samples` of each pixel with these AOVs, in as many dispatches as it takes.
    pub(super) fn new(
        gpu: &'a Gpu,
        traced: &TracedScene,
        (kernels, pace): (&RenderKernels, &Arc<Pace>),
        aovs: Aovs,
        (n_groups, n_samples): (u32, u32),
    ) -> Result<Self, GpuError> {
        let mut max_groups = MAX.min(n_groups.max(1)).min(kernels.max_groups(gpu, aovs, pace));
        let n_cells = n_groups.div_ceil(n_samples.max(1));
        loop {
            match Self::of(gpu, traced, (kernels.clone(), pace), aovs, [max_groups, n_cells, n_samples]) {
                // Fewer samples at once take less memory; the buffers of this attempt are too large.
                Err(GpuError::Limit { .. } | GpuError::OutOfMemory { .. }) if max_groups > FEW => {
                    gpu.free_work_buffers();
                    max_groups = (max_groups / 4).max(FEW);
                }
                made => return made,
            }
        }
    }

    /// With buffers for so many work-groups of a dispatch, and cells.
    fn of(
        gpu: &'a Gpu,
        traced: &TracedScene,
        (kernels, pace): (RenderKernels, &Arc<Pace>),
        aovs: Aovs,
        [max_groups, n_cells, n_samples]: [u32; 3],
    ) -> Result<Self, GpuError> {
        let slice = Slice { first_group: 0, end_group: 0, first_sample: 0, n_samples: 1, first_cell: 0 };
        Ok(Self {
            gpu,
            kernels: ReadyKernels::new(gpu, traced, (kernels, pace), [max_groups, n_cells, n_samples])?,
            slice: gpu.uniform("slice", &slice)?,
            records: Records::new(gpu, aovs, max_groups as usize * CELL_PIXELS)?,
            max_groups,
            // As many as of the picture before: frames differ little, and a dispatch that costs 20 times as much still ends before drivers give it up.
            n_groups: pace.n_groups().max(FIRST).min(max_groups),
            pace: pace.clone(),
            n_exact_rays: 0,
        })
    }

    /// Cells that fill a dispatch if each takes `n_samples` samples.
    pub(super) fn n_cells(&self, n_samples: u32) -> usize {
        self.n_groups.div_ceil(n_samples.max(1)) as usize
    }

    /// Most cells of a call of [`Self::take`].
    pub(super) fn max_cells(&self) -> usize {
        self.kernels.sums.as_ref().map_or(usize::MAX, |sums| sums.n_cells())
    }

    /// Takes the samples of a run of each cell.
    ///
    /// `each` receives what was found of samples, the index of the first one of the 64 pixels of a cell, the number of the cell, and that of the sample, cell
    /// by cell in the order of samples: of all samples, or, where the device sums them, of those of a dispatch some of which the CPU must take. Then
    /// what it writes is summed. Returns the sums of all pixels, if the device makes them; nothing once `stop`, which is called between
    /// dispatches, returns true.
    ///
    /// # Errors
    /// Errors of the device.
    pub(super) fn take(
        &mut self,
        cells: &[u32],
        run: &SampleRun,
        bindings: &[NamedBinding<'_>],
        stop: &dyn Fn() -> bool,
        mut each: impl FnMut(&mut Samples, usize, usize, u32),
    ) -> Result<PixelSums, GpuError> {
        let n_samples = run.end - run.start;
        let all = cells.len() as u64 * u64::from(n_samples);
        let mut done = 0;
        let mut sums = PixelSums::default();
        while done < all && !stop() {
            // In windows of whole cells, so that work-groups are counted in 32 bits.
            let (cell, first_group) = ((done / u64::from(n_samples)) as usize, (done % u64::from(n_samples)) as u32);
            let n = u64::from(self.n_groups.min(self.max_groups)).min(all - done);
            let end_group = first_group + n as u32;
            let window = &cells[cell..(cell + end_group.div_ceil(n_samples) as usize)];
            let first_cell = cell as u32;
            let slice = Slice { first_group, end_group, first_sample: run.start, n_samples, first_cell };
            done += n;
            let n_sums = if done == all { cells.len() * CELL_PIXELS } else { 0 };
            sums = self.dispatch((window, slice), n_sums, bindings, |samples| {
                for group in 0..n as u32 {
                    let number = first_group + group;
                    let first = group as usize * CELL_PIXELS;
                    each(samples, first, cell + (number / n_samples) as usize, run.start + number % n_samples);
                }
            })?;
        }
        Ok(sums)
    }

    /// Takes the samples of a dispatch, and returns so many sums. `look` sees the samples that are downloaded.
    fn dispatch(
        &mut self,
        (cells, slice): (&[u32], Slice),
        n_sums: usize,
        bindings: &[NamedBinding<'_>],
        look: impl FnOnce(&mut Samples),
    ) -> Result<PixelSums, GpuError> {
        let start = Instant::now();
        let n = slice.end_group - slice.first_group;
        let size = [n, cells.len() as u32];
        let cells = self.gpu.buffer("cells", cells)?;
        self.gpu.write(&self.slice, &[slice]);
        let own: [NamedBinding<'_>; 2] = [("slice", &self.slice), ("cells", &cells)];
        let bindings: Vec<_> = own.into_iter().chain(self.records.bindings()).chain(bindings.iter().copied()).collect();
        self.kernels.run(self.gpu, &bindings, size)?;
        let mut time = start.elapsed();
        let n_samples = n as usize * CELL_PIXELS;
        let (samples, mut sums, has_unfinished) = loop {
            let (samples, sums, took) = self.kernels.read(self.gpu, &self.records.samples, [n_samples, n_sums])?;
            let Took { n_exact_rays, is_done, has_unfinished } = took;
            self.n_exact_rays += n_exact_rays;
            if is_done {
                break (samples, sums, has_unfinished);
            }
            let start = Instant::now();
            self.kernels.run_rest(self.gpu, &bindings, size)?;
            time += start.elapsed();
        };
        let made = match &self.kernels.sums {
            None => {
                look(&mut self.records.read(self.gpu, Some(samples), n_samples)?);
                PixelSums::default()
            }
            Some(on_device) => {
                if has_unfinished {
                    let mut samples = self.records.read(self.gpu, None, n_samples)?;
                    look(&mut samples);
                    // Now the CPU has taken those samples.
                    self.records.write(self.gpu, &samples);
                    self.kernels.finish(self.gpu.commands(), &bindings, size)?;
                    sums = block_on(self.gpu.read_first(&on_device.light.sums, n_sums))?;
                }
                on_device.read(self.gpu, sums, n_sums)?
            }
        };
        self.n_groups = next_size([n, self.n_groups], time, self.max_groups);
        self.pace.set_groups(self.n_groups);
        Ok(made)
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

/// A cell while its samples are taken.
struct Cell {
    /// Index among the tiles that are rendered together.
    tile: usize,
    /// Column and row in the picture, in cells.
    position: [u32; 2],
    /// The pixels, by column and row in the tile.
    pixels: Vec<[u32; 2]>,
    sums: Vec<Sums>,
    adaptive: Adaptive,
    n_rays: u64,
}

/// Renders tiles on a GPU.
pub(super) struct SampleCollector<'a> {
    pub(super) dispatcher: SampleDispatcher<'a>,
    /// Bindings of picture and scene.
    pub(super) bindings: Vec<NamedBinding<'a>>,
    pub(super) settings: &'a Settings,
    /// The weight of a sample.
    pub(super) weight: &'a dyn Fn([u32; 2], u32) -> f32,
    /// Takes samples that the GPU could not finish.
    pub(super) tiles: &'a dyn RenderTiles,
}

impl SampleCollector<'_> {
    /// Renders tiles together: all cells take the same samples in the same dispatches until they are done. `None` once `stop`,
    /// which is called between dispatches, returns true.
    pub(super) fn tiles(
        &mut self,
        tiling: &Tiling,
        numbers: &[usize],
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<Tile>>, GpuError> {
        let mut waiting: Vec<Cell> = numbers
            .iter()
            .enumerate()
            .flat_map(|(tile, &number)| Cell::all(tile, number, tiling, self.settings))
            .collect();
        let mut tiles: Vec<Tile> = numbers.iter().map(|&number| tiling.tile(number)).collect();
        while let Some(samples) = waiting.first().map(|cell| cell.adaptive.next.clone()) {
            self.take(&mut waiting, &samples, stop)?;
            if stop() {
                return Ok(None);
            }
            // All waiting cells have taken the same samples, so they continue with the same ones.
            waiting.retain_mut(|cell| {
                let continues = cell.adaptive.advance(self.settings, &cell.sums);
                if !continues {
                    tiling.store(&cell.pixels, &cell.sums, &mut tiles[cell.tile]);
                    tiles[cell.tile].n_rays += cell.n_rays;
                }
                continues
            });
        }
        Ok(Some(tiles))
    }

    /// Takes the same samples of all cells.
    fn take(&mut self, cells: &mut [Cell], samples: &SampleRun, stop: &dyn Fn() -> bool) -> Result<(), GpuError> {
        let Self { weight, tiles, settings, .. } = *self;
        let is_summed = self.dispatcher.kernels.sums.is_some();
        // The sum of a first run has the bits of the film's. A part keeps the sum of each block.
        let is_one = !is_summed || (settings.part.is_none() && samples.start == 0);
        for run in runs(samples.clone(), is_one) {
            for cells in cells.chunks_mut(self.dispatcher.max_cells()) {
                let positions: Vec<u32> = cells.iter().map(|Cell { position: [x, y], .. }| x | y << 16).collect();
                let found = |samples: &mut Samples, first: usize, cell: usize, sample: u32| {
                    cells[cell].complete(samples, first, sample, tiles);
                    if !is_summed {
                        cells[cell].add(samples, first, sample, weight);
                    }
                };
                let sums = self.dispatcher.take(&positions, &run, &self.bindings, stop, found)?;
                if stop() {
                    return Ok(());
                }
                if is_summed {
                    for (cell, number) in cells.iter_mut().zip(0..) {
                        cell.add_sums(&sums, number * CELL_PIXELS, &run);
                    }
                }
            }
        }
        Ok(())
    }

    /// How many of the tiles `numbers` fill a dispatch.
    pub(super) fn n_tiles_per_dispatch(&self, tiling: &Tiling, numbers: &[usize]) -> usize {
        let n_samples = Adaptive::new(self.settings).next.len();
        let enough =
            self.dispatcher.n_cells(u32::try_from(n_samples).unwrap_or(u32::MAX)).min(self.dispatcher.max_cells());
        let mut n_cells = 0;
        let last = numbers.iter().position(|&number| {
            let [width, height] = tiling.size(number).map(|n| n.div_ceil(CELL) as usize);
            n_cells += width * height;
            n_cells >= enough
        });
        last.map_or(numbers.len(), |last| last + 1)
    }
}

impl Cell {
    /// The cells of a tile.
    fn all(tile: usize, number: usize, tiling: &Tiling, settings: &Settings) -> impl Iterator<Item = Self> + use<> {
        let (corner, settings) = (tiling.corner(number), *settings);
        tiling.cells(number).map(move |pixels| Self {
            tile,
            position: std::array::from_fn(|k| (corner[k] + pixels[0][k]) / CELL),
            sums: vec![Sums::default(); pixels.len()],
            pixels,
            adaptive: Adaptive::new(&settings),
            n_rays: 0,
        })
    }

    /// The index of each pixel among the 64 of the cell, and its position in the picture.
    fn places(&self) -> impl Iterator<Item = (usize, [u32; 2])> + use<> {
        let (corner, [left, top]) = (self.pixels[0], self.position.map(|at| at * CELL));
        let places: Vec<_> = self.pixels.iter().map(|[x, y]| [x - corner[0], y - corner[1]]).collect();
        places.into_iter().map(move |[x, y]| ((y * CELL + x) as usize, [left + x, top + y]))
    }

    /// The CPU takes what the device did not finish of a sample of each pixel; `first` is the index of the first of the 64.
    fn complete(&mut self, samples: &mut Samples, first: usize, sample: u32, tiles: &dyn RenderTiles) {
        for (index, pixel) in self.places() {
            if samples.is_unfinished(first + index) {
                let mut one = Sums::default();
                let n_rays = tiles.sample(pixel, sample, &mut one);
                self.n_rays += samples.complete(first + index, &one, n_rays);
            }
        }
    }

    /// Adds a sample of each pixel.
    fn add(&mut self, samples: &Samples, first: usize, sample: u32, weight: &dyn Fn([u32; 2], u32) -> f32) {
        for ((index, pixel), sums) in self.places().zip(&mut self.sums) {
            self.n_rays += samples.add_to(sums, first + index, sample, weight(pixel, sample));
        }
    }

    /// Adds the sums of all samples of a run; `first` is the index of the first of the 64.
    fn add_sums(&mut self, found: &PixelSums, first: usize, run: &SampleRun) {
        for ((index, _), sums) in self.places().zip(&mut self.sums) {
            self.n_rays += found.add_to(sums, first + index, run);
        }
    }
}

/// Rejects pictures whose cell positions exceed 16 bits.
pub(super) fn check_size(settings: &Settings) -> Result<(), RenderError> {
    let Settings { width, height, .. } = *settings;
    let max = CELL << 16;
    if width > max || height > max { Err(RenderError::Size { width, height }) } else { Ok(()) }
}

const _: () = assert!(CELL_PIXELS == (CELL * CELL) as usize, "a work-group has one invocation per pixel of a cell");

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
