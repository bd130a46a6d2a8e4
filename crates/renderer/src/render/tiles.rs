//! Takes the samples of a tile on the CPU.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use canted_film::{Aov, CELL, Components, Film, FilmBuilder, FilterSampler, Guide, Pixel, Sums, Tile, Tiling};
use canted_trace::{Counts, Hit};

use super::Adaptive;
use crate::integrate::{Seen, Start, Transport};
use crate::sampler::Numbers;
use crate::times::{Stage, Times};
use crate::{CountedHitFilter, Monitor, RenderError, Sampler, Settings, Surface, View};

/// Dimension of the sampler for the position in the pixel.
const PIXEL_POSITION: u32 = 0;

/// Dimension for the time, from the end that integrators do not reach.
const TIME: u32 = u32::MAX;

/// Dimension for the position on the lens.
const LENS: u32 = u32::MAX - 1;

/// How many samples are taken together; the picture does not depend on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Batch {
    /// Camera rays traced together.
    pub(super) rays: usize,
    /// Paths that then go on together.
    pub(super) paths: usize,
}

impl Batch {
    /// Enough camera rays for groups of them to walk together; paths enough to hide memory latency and few enough to stay in the caches.
    pub(super) const DEFAULT: Self = Self { rays: 1024, paths: 64 };
}

/// Renders tiles, whatever the query that the scene needs.
pub(crate) trait RenderTiles: Sync {
    /// Renders a tile; `None` once `stop`, which is called before each sample, returns true.
    fn tile(&self, number: usize, times: &mut Times, stop: &dyn Fn() -> bool) -> Option<Tile>;

    /// Adds one sample of a pixel to its sums; returns the number of rays.
    fn sample(&self, pixel: [u32; 2], sample: u32, sums: &mut Sums) -> u64;
}

/// A sample whose camera ray is not traced yet.
struct PixelSample {
    /// Index of the pixel in its cell.
    index: usize,
    pixel: [u32; 2],
    sample: u32,
}

/// What all tiles of a picture share.
pub(super) struct TileRenderer<'a> {
    pub(super) transport: &'a Transport<'a>,
    pub(super) view: &'a View,
    /// Whether samples have different times.
    pub(super) has_motion: bool,
    pub(super) filter: &'a FilterSampler,
    pub(super) settings: &'a Settings,
    pub(super) tiling: Tiling,
    pub(super) batch: Batch,
}

impl RenderTiles for TileRenderer<'_> {
    fn tile(&self, number: usize, times: &mut Times, stop: &dyn Fn() -> bool) -> Option<Tile> {
        let [left, top] = self.tiling.corner(number);
        let mut tile = self.tiling.tile(number);
        let mut sums = vec![Sums::default(); (CELL * CELL) as usize];
        for pixels in self.tiling.cells(number) {
            let positions = pixels.iter().map(|&[x, y]| [left + x, top + y]);
            self.cell(positions, &mut sums, &mut tile.n_rays, times, stop)?;
            self.tiling.store(&pixels, &sums, &mut tile);
            times.end(Stage::Film);
        }
        Some(tile)
    }

    fn sample(&self, pixel: [u32; 2], sample: u32, sums: &mut Sums) -> u64 {
        self.finish(
            &mut vec![PixelSample { index: 0, pixel, sample }],
            std::slice::from_mut(sums),
            &mut Times::new(),
            &|| false,
        )
        .unwrap_or_default()
    }
}

impl TileRenderer<'_> {
    /// Takes the samples of the pixels of a cell.
    fn cell(
        &self,
        pixels: impl ExactSizeIterator<Item = [u32; 2]> + Clone,
        sums: &mut [Sums],
        n_rays: &mut u64,
        times: &mut Times,
        stop: &dyn Fn() -> bool,
    ) -> Option<()> {
        let sums = &mut sums[..pixels.len()];
        sums.iter_mut().for_each(Sums::clear);
        let mut adaptive = Adaptive::new(self.settings);
        let mut started = vec![];
        loop {
            for (index, pixel) in pixels.clone().enumerate() {
                for sample in adaptive.next.clone() {
                    if stop() {
                        return None;
                    }
                    started.push(PixelSample { index, pixel, sample });
                    if started.len() == self.batch.rays {
                        *n_rays += self.finish(&mut started, sums, times, stop)?;
                    }
                }
            }
            *n_rays += self.finish(&mut started, sums, times, stop)?;
            if !adaptive.advance(self.settings, sums) {
                return Some(());
            }
        }
    }

    /// The camera rays of samples, and their weights by the filter.
    fn starts(&self, samples: &[PixelSample]) -> (Vec<Start>, Vec<f32>) {
        let number = |[x, y]: [u32; 2]| y * self.settings.width + x;
        let has_lens = self.view.has_lens();
        let (pairs, singles) = ([PIXEL_POSITION, LENS], [TIME]);
        let mut numbers = Numbers::new(self.transport.sampler);
        numbers.draw(
            samples.iter().map(|of| (number(of.pixel), of.sample)),
            &pairs[..1 + usize::from(has_lens)],
            &singles[..usize::from(self.has_motion)],
        );
        let start = |(i, &PixelSample { pixel: [x, y], sample, .. }): (usize, &PixelSample)| {
            let numbers = numbers.of(i);
            let ([dx, dy], weight) = self.filter.sample(numbers.pair(0));
            let position = [f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy];
            let ray =
                if has_lens { self.view.ray_through_lens(position, numbers.pair(1)) } else { self.view.ray(position) };
            let ray = ray.at_time(if self.has_motion { numbers.single(0) } else { 0.0 });
            (Start { ray, cone: self.view.cone(position, sample), pixel: number([x, y]), sample }, weight)
        };
        samples.iter().enumerate().map(start).unzip()
    }

    /// Traces paths, and adds the radiance and the AOVs of samples, in order, to the sums of their cell; returns the number of rays. `None` once `stop`,
    /// which is called before each few paths, returns true.
    fn finish(
        &self,
        started: &mut Vec<PixelSample>,
        sums: &mut [Sums],
        times: &mut Times,
        stop: &dyn Fn() -> bool,
    ) -> Option<u64> {
        let (starts, weights) = self.starts(started);
        times.end(Stage::Camera);
        let (hits, tests) = self.hits(&starts);
        times.end(Stage::Rays);
        let mut n_rays = 0;
        let mut surfaces = Vec::new();
        for (chunk, starts) in starts.chunks(self.batch.paths).enumerate() {
            if stop() {
                return None;
            }
            let first = chunk * self.batch.paths;
            let of_chunk = first..first + starts.len();
            let (hits, places) = (&hits[of_chunk.clone()], &started[of_chunk.clone()]);
            let weights = &weights[of_chunk.clone()];
            surfaces.clear();
            if self.tiling.has_guides() {
                for (i, (start, &PixelSample { index, .. })) in of_chunk.zip(starts.iter().zip(places)) {
                    let tests = tests.as_ref().map_or([0.0; 2], |tests| tests[i]);
                    let (surface, guide) = self.guide(start, hits[surfaces.len()], tests);
                    sums[index].guide.push_sample(start.sample, guide);
                    surfaces.push(surface);
                }
                times.end(Stage::Shading);
            }
            let lights = self.transport.samples(Seen { starts, hits, surfaces: &surfaces }, times);
            for ((&PixelSample { index, sample, .. }, &weight), light) in places.iter().zip(weights).zip(lights) {
                let pixel = Pixel::weighted(light.radiance, weight);
                sums[index].pixel.push_sample(sample, pixel);
                if self.tiling.has_components() {
                    let components = match pixel.n_dropped {
                        0 => Components::weighted(light.components, light.first, weight),
                        _ => Components::default(),
                    };
                    sums[index].components.push_sample(sample, components);
                }
                n_rays += light.n_rays;
            }
            times.end(Stage::Film);
        }
        started.clear();
        times.end(Stage::Film);
        Some(n_rays)
    }

    /// The hits of camera rays, and for each the tests of boxes and triangles where they are an AOV.
    fn hits(&self, starts: &[Start]) -> (Vec<Option<Hit>>, Option<Vec<[f64; 2]>>) {
        if self.settings.aovs.contains(Aov::Tests) {
            let (hits, tests) = starts.iter().map(|start| self.counted_hit(start)).unzip();
            return (hits, Some(tests));
        }
        (self.transport.camera_hits(starts), None)
    }

    /// The hit of a camera ray, and the tests of boxes and triangles.
    fn counted_hit(&self, start: &Start) -> (Option<Hit>, [f64; 2]) {
        let mut counted = CountedHitFilter { filter: self.transport.camera_query(start), counts: Counts::default() };
        let hit = self.transport.bvh.closest_hit_with(&start.ray, &mut counted);
        (hit, [counted.counts.boxes as f64, counted.counts.triangles as f64])
    }

    /// The surface that a camera ray hits, and what it sees as AOVs.
    fn guide(&self, start: &Start, hit: Option<Hit>, tests: [f64; 2]) -> (Option<Surface>, Guide) {
        let Start { ray, cone, .. } = start;
        if let Some((t, normal)) = self.transport.lights.shape_light_before(ray, hit.as_ref()) {
            // A light has no albedo and no instance.
            let depth = self.view.depth(ray.at(t.into()));
            let (normal, shading_normal) = (normal.into(), normal.into());
            return (None, Guide { n_hits: 1, depth, normal, shading_normal, tests, ..Guide::default() });
        }
        let Some(hit) = hit else { return (None, Guide { tests, ..Guide::default() }) };
        let surface = self.transport.surfaces.at_ray(&hit, ray, *cone);
        if self.transport.surfaces.scene().ground == Some(hit.instance.0) {
            // It is as bright as the background, and a denoiser that knew it from the background would show its edge.
            return (Some(surface), Guide { tests, ..Guide::default() });
        }
        let guide = Guide {
            n_hits: 1,
            first: Some([hit.instance.0, hit.primitive.0]),
            depth: self.view.depth(surface.position),
            normal: surface.normal,
            shading_normal: surface.shading_normal,
            albedo: surface.bsdf.albedo().map(f64::from),
            tests,
        };
        (Some(surface), guide)
    }
}

/// The offset of a sample from the center of a pixel, in pixels, and its weight.
pub(crate) fn sample_offset(filter: &FilterSampler, sampler: &Sampler, pixel: u32, sample: u32) -> ([f64; 2], f32) {
    filter.sample(sampler.pair(pixel, sample, PIXEL_POSITION))
}

// Distributes tiles among the threads of the CPU and a GPU.
//
// CPU threads take tiles from the front, the GPU takes them from the back, so each renders as many as its speed allows.
// When no tile is left to start, each also renders the unfinished tiles of the other, and the first result counts: neither
// waits for the other, however slow it is. Without a GPU only the first rule applies.

/// Tiles offered to the GPU at once.
const MAX_OFFERED: usize = 1 << 12;

/// Who renders tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Worker {
    Cpu,
    Device,
}

/// The tiles of a picture: finished, started and waiting.
pub(crate) struct Schedule<'a> {
    pub(crate) tiling: Tiling,
    monitor: &'a Monitor<'a>,
    is_done: Vec<AtomicBool>,
    state: Mutex<State>,
}

struct State {
    film: FilmBuilder,
    /// Whether the CPU, and whether the GPU, has started each tile.
    started: Vec<[bool; 2]>,
    /// Tiles that nobody has started, in order.
    waiting: VecDeque<usize>,
    n_done: usize,
    /// Tiles that the GPU finished first.
    n_by_device: usize,
}

impl<'a> Schedule<'a> {
    /// All tiles that are not in `done`.
    pub(crate) fn new(tiling: Tiling, done: Vec<Tile>, monitor: &'a Monitor<'a>) -> Result<Self, RenderError> {
        let n_tiles = tiling.n_tiles();
        let mut film = FilmBuilder::new(tiling.clone());
        let mut is_done = vec![false; n_tiles];
        for tile in done {
            if !tiling.fits(&tile) {
                return Err(RenderError::Tile { number: tile.number });
            }
            // A tile that was written twice counts once.
            if !std::mem::replace(&mut is_done[tile.number], true) {
                film.add(&tile);
            }
        }
        let waiting: VecDeque<usize> = (0..n_tiles).filter(|&number| !is_done[number]).collect();
        let n_done = n_tiles - waiting.len();
        let started = vec![[false; 2]; n_tiles];
        let state = Mutex::new(State { film, started, waiting, n_done, n_by_device: 0 });
        let is_done = is_done.into_iter().map(AtomicBool::new).collect();
        Ok(Self { tiling, monitor, is_done, state })
    }

    /// Renders on all threads of the pool.
    pub(crate) fn spawn_cpu_workers<'s>(&'s self, scope: &rayon::Scope<'s>, tiles: &'s dyn RenderTiles) {
        for _ in 0..rayon::current_num_threads() {
            scope.spawn(|_| {
                let mut times = Times::new();
                while let Some(number) = self.next_for_cpu() {
                    match tiles.tile(number, &mut times, &|| self.is_over(&[number])) {
                        Some(tile) => {
                            self.finish(tile, Worker::Cpu);
                            times.end(Stage::Film);
                        }
                        None if self.is_cancelled() => break,
                        // The GPU was first.
                        None => {}
                    }
                }
                if let Some(all) = self.monitor.times {
                    all.add(&times);
                }
            });
        }
    }

    /// The next tile for a CPU thread; `None` if none is left.
    fn next_for_cpu(&self) -> Option<usize> {
        let mut state = self.state();
        let number = state.waiting.pop_front().or_else(|| self.started_only_by(&state, Worker::Device).next())?;
        state.started[number][Worker::Cpu as usize] = true;
        Some(number)
    }

    /// The next tiles for the GPU, as many of those offered as `count` returns; empty if none is left.
    pub(crate) fn next_for_device(&self, count: impl FnOnce(&[usize]) -> usize) -> Vec<usize> {
        let mut state = self.state();
        let mut offered: Vec<usize> = state.waiting.iter().rev().take(MAX_OFFERED).copied().collect();
        if offered.is_empty() {
            offered = self.started_only_by(&state, Worker::Cpu).collect();
        } else {
            offered.truncate(count(&offered));
            let n_left = state.waiting.len() - offered.len();
            state.waiting.truncate(n_left);
        }
        for &number in &offered {
            state.started[number][Worker::Device as usize] = true;
        }
        offered
    }

    fn is_cancelled(&self) -> bool {
        self.monitor.cancel.load(Ordering::Relaxed)
    }

    /// Whether work on these tiles is no longer needed.
    pub(crate) fn is_over(&self, numbers: &[usize]) -> bool {
        self.is_cancelled() || numbers.iter().all(|&number| self.is_done[number].load(Ordering::Relaxed))
    }

    /// Stores a tile unless it is finished already.
    pub(crate) fn finish(&self, tile: Tile, worker: Worker) {
        let number = tile.number;
        if self.is_done[number].swap(true, Ordering::Relaxed) {
            return;
        }
        (self.monitor.finished)(&tile);
        let mut state = self.state();
        state.film.add(&tile);
        state.n_done += 1;
        state.n_by_device += usize::from(worker == Worker::Device);
        let (n_done, n_tiles) = (state.n_done, self.is_done.len());
        drop(state);
        (self.monitor.progress)(n_done, n_tiles);
    }

    /// The film, and the number of tiles that the GPU rendered.
    pub(crate) fn into_film(self) -> Result<(Film, usize), RenderError> {
        let State { film, n_done, n_by_device, .. } = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if n_done < self.is_done.len() {
            return Err(RenderError::Cancelled);
        }
        Ok((film.film(), n_by_device))
    }

    /// Unfinished tiles that only `worker` has started.
    fn started_only_by<'s>(&'s self, state: &'s State, worker: Worker) -> impl Iterator<Item = usize> + 's {
        let is_left = move |&number: &usize| {
            let started = state.started[number];
            started[worker as usize] && !started[1 - worker as usize] && !self.is_done[number].load(Ordering::Relaxed)
        };
        (0..self.is_done.len()).filter(is_left)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six tiles of 8 x 8 pixels.
    fn tiling() -> Tiling {
        Tiling::new([24, 16], 8, None, false)
    }

    #[test]
    fn each_starts_at_its_end_and_then_repeats_the_tiles_of_the_other() {
        let cancel = AtomicBool::new(false);
        let monitor = Monitor::quiet(&cancel);
        let tile = |number| tiling().tile(number);
        let schedule = Schedule::new(tiling(), vec![tile(1)], &monitor).unwrap();
        assert_eq!(schedule.next_for_cpu(), Some(0));
        let two = |offered: &[usize]| offered.len().min(2);
        assert_eq!(schedule.next_for_device(two), [5, 4]);
        assert_eq!(schedule.next_for_cpu(), Some(2));
        schedule.finish(tile(2), Worker::Cpu);
        assert_eq!(schedule.next_for_device(two), [3]);
        schedule.finish(tile(3), Worker::Device);
        // All others are started: 0 by the CPU, 4 and 5 by the GPU.
        assert_eq!(schedule.next_for_device(two), [0]);
        assert_eq!(schedule.next_for_cpu(), Some(4));
        assert_eq!(schedule.next_for_cpu(), Some(5));
        assert_eq!(schedule.next_for_cpu(), None);
        assert!(schedule.next_for_device(two).is_empty());
        assert!(!schedule.is_over(&[4, 5]));
        for number in [5, 4, 0] {
            schedule.finish(tile(number), Worker::Cpu);
            schedule.finish(tile(number), Worker::Device);
        }
        assert!(schedule.is_over(&[4, 5]));
        assert_eq!(schedule.into_film().unwrap().1, 1);
    }

    #[test]
    fn a_picture_without_all_tiles_is_cancelled() {
        let cancel = AtomicBool::new(true);
        let monitor = Monitor::quiet(&cancel);
        let schedule = Schedule::new(tiling(), vec![], &monitor).unwrap();
        assert!(schedule.is_over(&[0]));
        assert_eq!(schedule.into_film().err(), Some(RenderError::Cancelled));
    }
}
