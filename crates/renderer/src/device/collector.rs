//! Collects samples from a GPU into tiles.

use std::ops::Range;

use canted_film::{CELL, Guide, Pixel, Sums, Tile, Tiling};
use canted_gpu::{GpuError, NamedBinding};

use super::dispatcher::SampleDispatcher;
use super::kernels::{CELL_PIXELS, PackedGuide, PackedSample};
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
        let mut waiting: Vec<Cell> =
            numbers.iter().enumerate().flat_map(|(tile, &number)| self.cells(tile, number, tiling)).collect();
        let mut tiles: Vec<Tile> = numbers.iter().map(|&number| tiling.tile(number)).collect();
        while let Some(Range { start, end }) = waiting.first().map(|cell| cell.adaptive.next.clone()) {
            self.take(&mut waiting, [start, end - start], stop)?;
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

    fn cells(&self, tile: usize, number: usize, tiling: &Tiling) -> impl Iterator<Item = Cell> + use<> {
        let corner = tiling.corner(number);
        let settings = *self.settings;
        tiling.cells(number).map(move |pixels| Cell {
            tile,
            position: std::array::from_fn(|k| (corner[k] + pixels[0][k]) / CELL),
            sums: vec![Sums::default(); pixels.len()],
            pixels,
            adaptive: Adaptive::new(&settings),
            n_rays: 0,
        })
    }

    /// Takes the same samples of all cells.
    fn take(&mut self, cells: &mut [Cell], samples: [u32; 2], stop: &dyn Fn() -> bool) -> Result<(), GpuError> {
        let positions: Vec<u32> = cells.iter().map(|Cell { position: [x, y], .. }| x | y << 16).collect();
        let [first, n] = samples;
        let (mut cell, mut sample) = (0, first);
        let Self { weight, tiles, .. } = *self;
        self.dispatcher.take(&positions, samples, &self.bindings, |taken, guides| {
            cells[cell].add(taken, guides, sample, weight, tiles);
            sample += 1;
            if sample == first + n {
                (cell, sample) = (cell + 1, first);
            }
            !stop()
        })
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
    /// Adds one sample of each pixel.
    fn add(
        &mut self,
        taken: &[PackedSample],
        guides: &[PackedGuide],
        sample: u32,
        weight: &dyn Fn([u32; 2], u32) -> f32,
        tiles: &dyn RenderTiles,
    ) {
        let corner = self.pixels[0];
        for (&[x, y], sums) in self.pixels.iter().zip(&mut self.sums) {
            let [column, row] = [x - corner[0], y - corner[1]];
            let index = (row * CELL + column) as usize;
            let [red, green, blue, rays] = taken[index];
            let pixel = [self.position[0] * CELL + column, self.position[1] * CELL + row];
            if rays < 0.0 {
                // The traversal of a ray was cut short, so the sample is unknown.
                self.n_rays += tiles.sample(pixel, sample, sums);
                continue;
            }
            sums.pixel.push_sample(sample, Pixel::weighted([red, green, blue], weight(pixel, sample)));
            if let Some(guide) = guides.get(index) {
                sums.guide.push_sample(sample, Guide::from(guide));
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of rays")]
            let rays = rays as u64;
            self.n_rays += rays;
        }
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
