//! Takes samples on a GPU, about 100 ms at a time, and collects them into tiles.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use canted_film::{Block, CELL, Components, Dyadic, Guide, Sums, Tile, Tiling};
use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding, TracedScene, block_on};

use super::picture::{CELL_PIXELS, Pace, Slice};
use super::records::{
    PackedComponents, PackedFirstLight, PackedGuide, ReadyKernels, RenderKernels, SampleRecord, SampleRun, Taken,
    n_records,
};
use crate::render::{Adaptive, RenderTiles};
use crate::{RenderError, Settings};

/// Target time of a dispatch: short enough for a display that waits for it, long compared with the cost of starting one.
const TARGET: Duration = Duration::from_millis(100);

/// Work-groups of the first dispatch, before the speed of the device is known.
const FIRST: u32 = 64;

/// Maximum work-groups of a dispatch: 32 MiB of samples, if each is kept.
const MAX: u32 = 1 << 15;

/// What kernels found of the 64 pixels of a cell.
pub(super) struct Found<'a, R> {
    /// The samples of a block of each pixel.
    records: &'a [R],
    /// AOVs of each sample, pixel by pixel; empty where none is requested.
    guides: &'a [PackedGuide],
    /// The light of each sample in its parts, likewise.
    components: &'a [PackedComponents],
    /// What the first surface reflects in each sample, likewise.
    first_light: &'a [PackedFirstLight],
}

/// Takes samples of cells on a GPU, and returns records of them.
pub(super) struct SampleDispatcher<'a, R> {
    gpu: &'a Gpu,
    kernels: ReadyKernels,
    slice: Buffer<Slice>,
    records: Buffer<R>,
    /// AOVs of each sample, where they are requested.
    guides: Option<Buffer<PackedGuide>>,
    /// The light of each sample in its parts, where they are requested.
    components: Option<Buffer<PackedComponents>>,
    /// What the first surface reflects in each sample, where it is requested.
    first_light: Option<Buffer<PackedFirstLight>>,
    /// Work-groups of the next dispatch.
    n_groups: u32,
    pace: Arc<Pace>,
    /// Rays of streams that exact kernels traced.
    pub(super) n_exact_rays: u64,
}

impl<'a, R: SampleRecord> SampleDispatcher<'a, R> {
    /// For `n_groups` work-groups in all, in as many dispatches as it takes.
    pub(super) fn new(
        gpu: &'a Gpu,
        traced: &TracedScene,
        (kernels, pace): (RenderKernels, &Arc<Pace>),
        n_groups: u32,
    ) -> Result<Self, GpuError> {
        let slice = Slice { first_group: 0, end_group: 0, first_sample: 0, n_samples: 1, block: 1 };
        let slice = gpu.uniform("slice", &slice)?;
        let kernels = ReadyKernels::new(gpu, traced, (kernels, pace), MAX.min(n_groups.max(1)))?;
        let n = kernels.max_groups;
        let records = gpu.work_buffer(R::BINDING, n_records::<R>(gpu).min(n as usize * CELL_PIXELS))?;
        let n_samples = n as usize * CELL_PIXELS;
        let guides = kernels.has_guides().then(|| gpu.work_buffer("guides", n_samples)).transpose()?;
        let components = kernels.has_components.then(|| gpu.work_buffer("components", n_samples)).transpose()?;
        let first_light = kernels.has_first_light.then(|| gpu.work_buffer("first_light", n_samples)).transpose()?;
        Ok(Self {
            gpu,
            kernels,
            slice,
            records,
            guides,
            components,
            first_light,
            // Other samples may cost more than those before, and a first dispatch, which includes compilation, is no reason for fewer.
            n_groups: (pace.n_groups() / 4).max(FIRST).min(n),
            pace: pace.clone(),
            n_exact_rays: 0,
        })
    }

    /// Cells that fill a dispatch if each takes `n_samples` samples.
    pub(super) fn n_cells(&self, n_samples: u32) -> usize {
        self.n_groups.div_ceil(n_samples.max(1)) as usize
    }

    /// Takes the samples of a run of each cell.
    ///
    /// `each` receives what was found of 64 pixels at a time, for one block of samples; cell by cell in the order of blocks. It stops the
    /// work by returning false.
    ///
    /// # Errors
    /// Errors of the device.
    pub(super) fn take(
        &mut self,
        cells: &[u32],
        run: SampleRun,
        bindings: &[NamedBinding<'_>],
        mut each: impl FnMut(Found<'_, R>) -> bool,
    ) -> Result<(), GpuError> {
        let SampleRun { first: first_sample, n: n_samples, block } = run;
        let all = cells.len() as u64 * u64::from(n_samples);
        let mut done = 0;
        // A dispatch may end between the pixels of a cell.
        let mut found = Downloads::default();
        while done < all {
            // In windows of whole cells, so that work-groups are counted in 32 bits.
            let (cell, start_group) = ((done / u64::from(n_samples)) as usize, (done % u64::from(n_samples)) as u32);
            let n = u64::from(self.n_groups).min(self.max_groups(block)).min(all - done);
            let end_group = start_group + n as u32;
            let window = &cells[cell..(cell + end_group.div_ceil(n_samples) as usize)];
            let slice = Slice { first_group: start_group, end_group, first_sample, n_samples, block };
            self.dispatch(window, slice, bindings, &mut found)?;
            done += n;
            let n_samples = CELL_PIXELS * block as usize;
            if !found.whole(n_samples).all(&mut each) {
                return Ok(());
            }
            found.remove_whole(n_samples);
        }
        Ok(())
    }

    /// Work-groups whose records fit in memory.
    fn max_groups(&self, block: u32) -> u64 {
        (self.records.len() as u64 * u64::from(block) / CELL_PIXELS as u64).min(self.kernels.max_groups.into())
    }

    /// Appends what a dispatch found.
    fn dispatch(
        &mut self,
        cells: &[u32],
        slice: Slice,
        bindings: &[NamedBinding<'_>],
        found: &mut Downloads<R>,
    ) -> Result<(), GpuError> {
        let start = Instant::now();
        let n = slice.end_group - slice.first_group;
        let cells = self.gpu.buffer("cells", cells)?;
        self.gpu.write(&self.slice, &[slice]);
        let own: [NamedBinding<'_>; 3] = [("slice", &self.slice), ("cells", &cells), (R::BINDING, &self.records)];
        let guides = self.guides.as_ref().map(|guides| -> NamedBinding<'_> { ("guides", guides) });
        let components = self.components.as_ref().map(|parts| -> NamedBinding<'_> { ("components", parts) });
        let first_light = self.first_light.as_ref().map(|parts| -> NamedBinding<'_> { ("first_light", parts) });
        let kept = guides.into_iter().chain(components).chain(first_light);
        let bindings: Vec<NamedBinding<'_>> = own.into_iter().chain(kept).chain(bindings.iter().copied()).collect();
        self.kernels.run(self.gpu, &bindings, n)?;
        let mut time = start.elapsed();
        let n_samples = n as usize * CELL_PIXELS;
        let n_records = n_samples / slice.block as usize;
        loop {
            let (records, beside) = block_on(self.gpu.read_beside(&self.records, n_records, &self.kernels.beside()))?;
            let (n_exact, is_done) = self.kernels.took(&beside);
            self.n_exact_rays += n_exact;
            if is_done {
                found.records.extend(records);
                break;
            }
            let start = Instant::now();
            self.kernels.run_rest(self.gpu, &bindings, n)?;
            time += start.elapsed();
        }
        if let Some(guides) = &self.guides {
            found.guides.extend(block_on(self.gpu.read_first(guides, n_samples))?);
        }
        if let Some(components) = &self.components {
            found.components.extend(block_on(self.gpu.read_first(components, n_samples))?);
        }
        if let Some(first_light) = &self.first_light {
            found.first_light.extend(block_on(self.gpu.read_first(first_light, n_samples))?);
        }
        self.n_groups = next_size([n, self.n_groups], time, self.kernels.max_groups);
        self.pace.set_groups(self.n_groups);
        Ok(())
    }
}

/// What dispatches found that is not yet summed.
struct Downloads<R> {
    records: Vec<R>,
    guides: Vec<PackedGuide>,
    components: Vec<PackedComponents>,
    first_light: Vec<PackedFirstLight>,
}

impl<R> Default for Downloads<R> {
    fn default() -> Self {
        Self { records: Vec::new(), guides: Vec::new(), components: Vec::new(), first_light: Vec::new() }
    }
}

impl<R> Downloads<R> {
    /// What was found of cells whose pixels have all their samples of a block, `n_samples` of a cell.
    fn whole(&self, n_samples: usize) -> impl Iterator<Item = Found<'_, R>> {
        let mut guides = self.guides.chunks_exact(n_samples);
        let mut components = self.components.chunks_exact(n_samples);
        let mut first_light = self.first_light.chunks_exact(n_samples);
        self.records.chunks_exact(CELL_PIXELS).map(move |records| Found {
            records,
            guides: guides.next().unwrap_or_default(),
            components: components.next().unwrap_or_default(),
            first_light: first_light.next().unwrap_or_default(),
        })
    }

    /// Removes these cells.
    fn remove_whole(&mut self, n_samples: usize) {
        let n_whole = self.records.len() / CELL_PIXELS;
        self.records.drain(..n_whole * CELL_PIXELS);
        self.guides.drain(..self.guides.len().min(n_whole * n_samples));
        self.components.drain(..self.components.len().min(n_whole * n_samples));
        self.first_light.drain(..self.first_light.len().min(n_whole * n_samples));
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
pub(super) struct SampleCollector<'a, R> {
    pub(super) dispatcher: SampleDispatcher<'a, R>,
    /// Bindings of picture and scene.
    pub(super) bindings: Vec<NamedBinding<'a>>,
    pub(super) settings: &'a Settings,
    /// The weight of a sample.
    pub(super) weight: &'a dyn Fn([u32; 2], u32) -> f32,
    /// Takes samples that the GPU could not finish.
    pub(super) tiles: &'a dyn RenderTiles,
}

impl<R: SampleRecord> SampleCollector<'_, R> {
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
        while let Some(Range { start, end }) = waiting.first().map(|cell| cell.adaptive.next.clone()) {
            self.take(&mut waiting, [start, end], stop)?;
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

    /// Takes the same samples, from a first one up to an end, of all cells.
    fn take(&mut self, cells: &mut [Cell], samples: [u32; 2], stop: &dyn Fn() -> bool) -> Result<(), GpuError> {
        let positions: Vec<u32> = cells.iter().map(|Cell { position: [x, y], .. }| x | y << 16).collect();
        let Self { weight, tiles, .. } = *self;
        for run in SampleRun::all(samples, R::MAX_BLOCK) {
            let end = run.first + run.n;
            let (mut cell, mut block) = (0, Block { first: run.first, len: run.block });
            self.dispatcher.take(&positions, run, &self.bindings, |found| {
                cells[cell].add(&found, block, weight, tiles);
                block.first += block.len;
                if block.first == end {
                    (cell, block.first) = (cell + 1, run.first);
                }
                !stop()
            })?;
            if stop() {
                break;
            }
        }
        Ok(())
    }

    /// How many of the tiles `numbers` fill a dispatch.
    pub(super) fn n_tiles_per_dispatch(&self, tiling: &Tiling, numbers: &[usize]) -> usize {
        let n_samples = Adaptive::new(self.settings).next.len();
        let enough = self.dispatcher.n_cells(u32::try_from(n_samples).unwrap_or(u32::MAX));
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

    /// Adds a block of samples of each pixel.
    fn add<R: SampleRecord>(
        &mut self,
        found: &Found<'_, R>,
        block: Block,
        weight: &dyn Fn([u32; 2], u32) -> f32,
        tiles: &dyn RenderTiles,
    ) {
        let corner = self.pixels[0];
        for (&[x, y], sums) in self.pixels.iter().zip(&mut self.sums) {
            let [column, row] = [x - corner[0], y - corner[1]];
            let index = (row * CELL + column) as usize;
            let pixel = [self.position[0] * CELL + column, self.position[1] * CELL + row];
            let Taken { pixel: mut of_block, n_rays, unfinished } =
                found.records[index].taken(block, |sample| weight(pixel, sample));
            self.n_rays += n_rays;
            let n = block.len as usize;
            let guides = found.guides.chunks_exact(n).nth(index).unwrap_or_default();
            let components = found.components.chunks_exact(n).nth(index).unwrap_or_default();
            let first_light = found.first_light.chunks_exact(n).nth(index).unwrap_or_default();
            let mut by_cpu = Dyadic::default();
            for (k, sample) in (0..block.len).map(|k| (k as usize, block.first + k)) {
                let is_unfinished = unfinished >> k & 1 == 1;
                let guide = guides.get(k);
                let is_known = !is_unfinished && guide.is_none_or(PackedGuide::is_complete);
                let mut one = Sums::default();
                if !is_known {
                    self.n_rays += tiles.sample(pixel, sample, &mut one);
                }
                if is_unfinished {
                    by_cpu.push_sample(sample, one.pixel.total());
                }
                if let Some(guide) = guide {
                    let guide = if is_known { tiles.kept(guide.into()) } else { one.guide.total() };
                    sums.guide.push_sample(sample, guide);
                }
                if let Some(&components) = components.get(k) {
                    let by_device =
                        || Components::weighted(components, first_light.get(k).copied(), weight(pixel, sample));
                    let components = if is_unfinished { one.components.total() } else { by_device() };
                    sums.components.push_sample(sample, components);
                }
            }
            if unfinished != 0 {
                let by_cpu = by_cpu.total();
                of_block = if of_block.n_taken() == 0 { by_cpu } else { of_block + by_cpu };
            }
            sums.pixel.push(block, of_block);
        }
    }
}

impl PackedGuide {
    /// Whether the traversal of the camera ray was not cut short.
    fn is_complete(&self) -> bool {
        self.primitive != u32::MAX - 1
    }
}

impl From<&PackedGuide> for Guide {
    fn from(guide: &PackedGuide) -> Self {
        let is_triangle = guide.instance != u32::MAX;
        Self {
            n_hits: (is_triangle || guide.primitive != u32::MAX).into(),
            first: is_triangle.then_some([guide.instance, guide.primitive]),
            depth: guide.depth.into(),
            normal: guide.normal.map(f64::from),
            shading_normal: guide.shading_normal.map(f64::from),
            albedo: guide.albedo.map(f64::from),
            tests: [guide.n_boxes, guide.n_triangles].map(f64::from),
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
