//! Tiles made of a device's samples.

use std::ops::Range;

use canted_film::{CELL, Sums, Tiling};
use canted_film::{Guide, Pixel, Tile};
use canted_gpu::{GpuError, NamedBinding};

use super::slices::{CELL_PIXELS, Seen, Slicer, Taken};
use crate::render::Course;
use crate::{RenderError, Settings};

/// A cell while its samples are taken.
struct Cell {
    /// Index of its tile among those that are made together.
    tile: usize,
    /// Place in the picture, in cells.
    at: [u32; 2],
    /// Its pixels, by column and row in the tile.
    pixels: Vec<[u32; 2]>,
    sums: Vec<Sums>,
    course: Course,
    n_rays: u64,
}

/// Takes samples on a device.
pub(super) struct Taker<'a> {
    pub(super) slicer: Slicer<'a>,
    /// What its kernel binds of picture and scene.
    pub(super) bound: Vec<NamedBinding<'a>>,
    pub(super) settings: &'a Settings,
    /// What a sample of a pixel weighs.
    pub(super) weight: &'a dyn Fn([u32; 2], u32) -> f32,
    /// Takes a sample of a pixel into its sums where the device could not finish it; returns the rays.
    pub(super) on_cpu: &'a dyn Fn([u32; 2], u32, &mut Sums) -> u64,
}

/// Makes the tiles of these numbers together: all their cells take the same samples in the same dispatches, and those that are done
/// drop out. `None` once `stop` says so, which is asked between dispatches.
pub(super) fn tiles(
    taker: &mut Taker,
    tiling: &Tiling,
    numbers: &[usize],
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<Tile>>, GpuError> {
    let mut waiting: Vec<Cell> =
        numbers.iter().enumerate().flat_map(|(tile, &number)| cells(tile, number, tiling, taker.settings)).collect();
    let mut tiles: Vec<Tile> = numbers.iter().map(|&number| tiling.tile(number)).collect();
    while let Some(Range { start, end }) = waiting.first().map(|cell| cell.course.next.clone()) {
        take(taker, &mut waiting, [start, end - start], stop)?;
        if stop() {
            return Ok(None);
        }
        // All cells that wait have taken the same samples, so they go on to the same ones.
        waiting.retain_mut(|cell| {
            let goes_on = cell.course.goes_on(taker.settings, &cell.sums);
            if !goes_on {
                tiling.store(&cell.pixels, &cell.sums, &mut tiles[cell.tile]);
                tiles[cell.tile].n_rays += cell.n_rays;
            }
            goes_on
        });
    }
    Ok(Some(tiles))
}

fn cells(tile: usize, number: usize, tiling: &Tiling, settings: &Settings) -> impl Iterator<Item = Cell> {
    let corner = tiling.corner(number);
    tiling.cells(number).map(move |pixels| Cell {
        tile,
        at: std::array::from_fn(|k| (corner[k] + pixels[0][k]) / CELL),
        sums: vec![Sums::default(); pixels.len()],
        pixels,
        course: Course::new(settings),
        n_rays: 0,
    })
}

/// Takes the same samples of all cells.
fn take(taker: &mut Taker, waiting: &mut [Cell], samples: [u32; 2], stop: &dyn Fn() -> bool) -> Result<(), GpuError> {
    let places: Vec<u32> = waiting.iter().map(|Cell { at: [x, y], .. }| x | y << 16).collect();
    let [first, n] = samples;
    let (mut cell, mut sample) = (0, first);
    let Taker { weight, on_cpu, .. } = *taker;
    taker.slicer.take(&places, samples, &taker.bound, |taken: &[Taken], seen: &[Seen]| {
        add(taken, seen, &mut waiting[cell], sample, weight, on_cpu);
        sample += 1;
        if sample == first + n {
            (cell, sample) = (cell + 1, first);
        }
        !stop()
    })
}

/// Adds a sample of each of a cell's pixels.
fn add(
    taken: &[Taken],
    seen: &[Seen],
    cell: &mut Cell,
    sample: u32,
    weight: &dyn Fn([u32; 2], u32) -> f32,
    on_cpu: &dyn Fn([u32; 2], u32, &mut Sums) -> u64,
) {
    let corner = cell.pixels[0];
    for (&[x, y], sums) in cell.pixels.iter().zip(&mut cell.sums) {
        let [column, row] = [x - corner[0], y - corner[1]];
        let local = (row * CELL + column) as usize;
        let [red, green, blue, rays] = taken[local];
        let at = [cell.at[0] * CELL + column, cell.at[1] * CELL + row];
        if rays < 0.0 {
            // A ray was cut short: what it brought is not known.
            cell.n_rays += on_cpu(at, sample, sums);
            continue;
        }
        sums.pixel.push_sample(sample, Pixel::weighed([red, green, blue], weight(at, sample)));
        if let Some(seen) = seen.get(local) {
            sums.guide.push_sample(sample, guide(seen));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of rays")]
        let rays = rays as u64;
        cell.n_rays += rays;
    }
}

fn guide(seen: &Seen) -> Guide {
    let is_triangle = seen.instance != u32::MAX;
    Guide {
        n_hits: (is_triangle || seen.primitive != u32::MAX).into(),
        first: is_triangle.then_some([seen.instance, seen.primitive]),
        depth: seen.depth.into(),
        normal: seen.normal.map(f64::from),
        shading_normal: seen.shading_normal.map(f64::from),
        albedo: seen.albedo.map(f64::from),
        tests: [seen.n_boxes, seen.n_triangles].map(f64::from),
    }
}

/// Cuts tiles that are not done into runs that are worth a dispatch each.
pub(super) fn next_run(slicer: &Slicer, tiling: &Tiling, settings: &Settings, left: &[usize]) -> usize {
    let n_samples = Course::new(settings).next.len();
    let worth = slicer.worth(u32::try_from(n_samples).unwrap_or(u32::MAX));
    let mut n_cells = 0;
    let enough = left.iter().position(|&number| {
        let [width, height] = tiling.size(number).map(|n| n.div_ceil(CELL) as usize);
        n_cells += width * height;
        n_cells >= worth
    });
    enough.map_or(left.len(), |last| last + 1)
}

/// Refuses pictures whose cells have no number.
pub(super) fn check(settings: &Settings) -> Result<(), RenderError> {
    let Settings { width, height, .. } = *settings;
    let most = CELL << 16;
    if width > most || height > most { Err(RenderError::Size { width, height }) } else { Ok(()) }
}

const _: () = assert!(CELL_PIXELS == (CELL * CELL) as usize, "a work-group has an invocation for each pixel of a cell");
