//! Takes the samples of a tile on the CPU.

use canted_film::{Aov, CELL, FilterSampler, Guide, Pixel, Sums, Tile, Tiling};
use canted_trace::{Counts, Hit, Query};

use super::Adaptive;
use crate::integrate::{Start, Transport};
use crate::query::{RayKeyed, forward};
use crate::{Sampler, Settings, Tracer, View};

/// Dimension of the sampler for the position in the pixel.
const PIXEL_POSITION: u32 = 0;

/// Dimension for the time, from the end that integrators do not reach.
const TIME: u32 = u32::MAX;

/// Dimension for the position on the lens.
const LENS: u32 = u32::MAX - 1;

/// Samples traced together: enough to hide memory latency, few enough for their paths to stay in the caches.
const BATCH: usize = 64;

/// Renders tiles, whatever the query that the scene needs.
pub(crate) trait RenderTiles: Sync {
    /// Renders a tile; `None` once `stop`, which is called before each pixel, returns true.
    fn tile(&self, number: usize, stop: &dyn Fn() -> bool) -> Option<Tile>;

    /// Adds one sample of a pixel to its sums; returns the number of rays.
    fn sample(&self, pixel: [u32; 2], sample: u32, sums: &mut Sums) -> u64;
}

/// What all tiles of a picture share.
pub(super) struct TileRenderer<'a, T, Q> {
    pub(super) transport: &'a Transport<'a, T, Q>,
    pub(super) view: &'a View,
    /// Whether samples have different times.
    pub(super) has_motion: bool,
    pub(super) filter: &'a FilterSampler,
    pub(super) settings: &'a Settings,
    pub(super) tiling: Tiling,
}

impl<T: Tracer, Q: RayKeyed + Sync> RenderTiles for TileRenderer<'_, T, Q> {
    fn tile(&self, number: usize, stop: &dyn Fn() -> bool) -> Option<Tile> {
        let [left, top] = self.tiling.corner(number);
        let mut tile = self.tiling.tile(number);
        let mut sums = vec![Sums::default(); (CELL * CELL) as usize];
        for pixels in self.tiling.cells(number) {
            let positions = pixels.iter().map(|&[x, y]| [left + x, top + y]);
            self.cell(positions, &mut sums, &mut tile.n_rays, stop)?;
            self.tiling.store(&pixels, &sums, &mut tile);
        }
        Some(tile)
    }

    fn sample(&self, pixel: [u32; 2], sample: u32, sums: &mut Sums) -> u64 {
        let started = self.start(pixel, sample, 0, sums);
        self.finish(&mut vec![started], std::slice::from_mut(sums))
    }
}

impl<T: Tracer, Q: RayKeyed> TileRenderer<'_, T, Q> {
    /// Takes the samples of the pixels of a cell.
    fn cell(
        &self,
        pixels: impl ExactSizeIterator<Item = [u32; 2]> + Clone,
        sums: &mut [Sums],
        n_rays: &mut u64,
        stop: &dyn Fn() -> bool,
    ) -> Option<()> {
        let sums = &mut sums[..pixels.len()];
        sums.iter_mut().for_each(Sums::clear);
        let mut adaptive = Adaptive::new(self.settings);
        let mut started = Vec::with_capacity(BATCH);
        loop {
            for (index, pixel) in pixels.clone().enumerate() {
                if stop() {
                    return None;
                }
                for sample in adaptive.next.clone() {
                    started.push(self.start(pixel, sample, index, &mut sums[index]));
                    if started.len() == BATCH {
                        *n_rays += self.finish(&mut started, sums);
                    }
                }
            }
            *n_rays += self.finish(&mut started, sums);
            if !adaptive.advance(self.settings, sums) {
                return Some(());
            }
        }
    }

    /// Traces the camera ray of a sample, and adds its AOVs to the sums of the pixel with this index in the cell.
    fn start(&self, [x, y]: [u32; 2], sample: u32, index: usize, sums: &mut Sums) -> Started {
        let number = y * self.settings.width + x;
        let ([dx, dy], weight) = sample_offset(self.filter, &self.transport.sampler, number, sample);
        let position = [f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy];
        let ray = if self.view.has_lens() {
            self.view.ray_through_lens(position, self.transport.sampler.pair(number, sample, LENS))
        } else {
            self.view.ray(position)
        };
        let time = if self.has_motion { self.transport.sampler.single(number, sample, TIME) } else { 0.0 };
        let start = Start { ray, cone: self.view.cone(position, sample), time, pixel: number, sample };
        let hit = if self.tiling.has_guides() {
            let (hit, guide) = self.guide(&start);
            sums.guide.push_sample(sample, guide);
            hit
        } else {
            self.transport.tracer.closest_hit(&ray, &mut self.transport.camera_query(&start))
        };
        Started { start, hit, index, weight }
    }

    /// Adds the radiance of samples, in order, to the sums of their cell; returns the number of rays.
    fn finish(&self, started: &mut Vec<Started>, sums: &mut [Sums]) -> u64 {
        let mut n_rays = 0;
        let lights = self.transport.samples(started.iter().map(|started| (started.start, started.hit)));
        for (Started { start, index, weight, .. }, light) in started.drain(..).zip(lights) {
            sums[index].pixel.push_sample(start.sample, Pixel::weighted(light.radiance, weight));
            n_rays += light.n_rays;
        }
        n_rays
    }

    /// The first hit of a camera ray, and its AOVs.
    fn guide(&self, start: &Start) -> (Option<Hit>, Guide) {
        let Start { ray, cone, time, .. } = start;
        let query = self.transport.camera_query(start);
        let (hit, tests) = if self.settings.aovs.contains(Aov::Tests) {
            let mut counted = Counted { inner: query, counts: Counts::default() };
            let hit = self.transport.tracer.closest_hit(ray, &mut counted);
            #[expect(clippy::cast_precision_loss, reason = "counts of one ray are below 2^53")]
            (hit, [counted.counts.boxes as f64, counted.counts.triangles as f64])
        } else {
            (self.transport.tracer.closest_hit(ray, &mut { query }), [0.0; 2])
        };
        if let Some((t, normal)) = self.transport.lights.shape_light_before(ray, hit.as_ref()) {
            // A light has no albedo and no instance.
            let depth = self.view.depth(ray.at(t.into()));
            return (hit, Guide { n_hits: 1, depth, normal, shading_normal: normal, tests, ..Guide::default() });
        }
        let Some(hit) = hit else { return (None, Guide { tests, ..Guide::default() }) };
        let surface = self.transport.surfaces.at_time(&hit, ray.direction, *time, *cone);
        let guide = Guide {
            n_hits: 1,
            first: Some([hit.instance.0, hit.primitive.0]),
            depth: self.view.depth(surface.position),
            normal: surface.normal,
            shading_normal: surface.shading_normal,
            albedo: surface.bsdf.albedo().map(f64::from),
            tests,
        };
        (Some(hit), guide)
    }
}

/// The offset of a sample from the center of a pixel, in pixels, and its weight.
pub(crate) fn sample_offset(filter: &FilterSampler, sampler: &Sampler, pixel: u32, sample: u32) -> ([f64; 2], f32) {
    filter.sample(sampler.pair(pixel, sample, PIXEL_POSITION))
}

/// A sample whose camera ray is traced.
struct Started {
    start: Start,
    hit: Option<Hit>,
    /// Index of the pixel in its cell.
    index: usize,
    /// Weight by the filter.
    weight: f32,
}

/// Counts tests; `inner` accepts hits.
struct Counted<Q> {
    inner: Q,
    counts: Counts,
}

impl<Q: Query> Query for Counted<Q> {
    const MAY_REJECT: bool = Q::MAY_REJECT;

    forward!(counters: counts, mask: inner);

    fn time(&self) -> f32 {
        self.inner.time()
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.inner.accepts(hit)
    }
}
