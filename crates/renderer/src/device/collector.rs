//! Collects samples from a GPU into tiles.

use std::ops::Range;

use canted_film::{Block, CELL, Dyadic, Guide, Sums, Tile, Tiling};
use canted_gpu::{GpuError, NamedBinding};

use super::dispatcher::SampleDispatcher;
use super::kernels::{CELL_PIXELS, PackedGuide};
use super::records::{SampleRecord, SampleRun, Taken};
use crate::render::{Adaptive, RenderTiles};
use crate::{RenderError, Settings};

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
            self.dispatcher.take(&positions, run, &self.bindings, |taken, guides| {
                cells[cell].add(taken, guides, block, weight, tiles);
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
        taken: &[R],
        guides: &[PackedGuide],
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
                taken[index].taken(block, |sample| weight(pixel, sample));
            self.n_rays += n_rays;
            let guides = guides.chunks_exact(block.len as usize).nth(index).unwrap_or_default();
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
                    sums.guide.push_sample(sample, if is_known { guide.into() } else { one.guide.total() });
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
