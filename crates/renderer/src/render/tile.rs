//! Samples of a tile.

use canted_film::{Aov, CELL, FilterSampler, Guide, Pixel, Sums, Tile, Tiling};
use canted_trace::{Counts, Hit, Query};

use super::Course;
use crate::integrate::{Start, Transport};
use crate::query::RayKeyed;
use crate::{Sampler, Settings, Tracer, View};

/// Dimension of the sampler that places a sample in its pixel.
const PIXEL_POSITION: u32 = 0;

/// Dimension that chooses a sample's time, apart from those that integrators count up.
const TIME: u32 = u32::MAX;

/// Dimension that places a sample on the lens, likewise.
const LENS: u32 = u32::MAX - 1;

/// Samples that are taken side by side: enough for waits to overlap, few enough for their paths to stay in the caches.
const BATCH: usize = 64;

/// What all tiles of a picture share.
pub(super) struct Work<'a, T, Q> {
    pub(super) transport: &'a Transport<'a, T, Q>,
    pub(super) view: &'a View,
    /// Whether samples have times of their own.
    pub(super) moves: bool,
    pub(super) filter: &'a FilterSampler,
    pub(super) settings: &'a Settings,
    pub(super) tiling: Tiling,
}

impl<T: Tracer, Q: RayKeyed> Work<'_, T, Q> {
    /// Renders a tile; `None` once `stop` says so, which is asked at every pixel.
    pub(super) fn tile(&self, number: usize, stop: &dyn Fn() -> bool) -> Option<Tile> {
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

    /// Takes the samples of neighbouring pixels, all of them or until their noise is low enough.
    fn cell(
        &self,
        pixels: impl ExactSizeIterator<Item = [u32; 2]> + Clone,
        sums: &mut [Sums],
        n_rays: &mut u64,
        stop: &dyn Fn() -> bool,
    ) -> Option<()> {
        let sums = &mut sums[..pixels.len()];
        for sums in &mut *sums {
            sums.clear();
        }
        let mut course = Course::new(self.settings);
        let mut begun = Vec::with_capacity(BATCH);
        loop {
            for (place, pixel) in pixels.clone().enumerate() {
                if stop() {
                    return None;
                }
                for sample in course.next.clone() {
                    begun.push(self.begin(pixel, sample, place, &mut sums[place]));
                    if begun.len() == BATCH {
                        *n_rays += self.finish(&mut begun, sums);
                    }
                }
            }
            *n_rays += self.finish(&mut begun, sums);
            if !course.goes_on(self.settings, sums) {
                return Some(());
            }
        }
    }

    /// Takes one sample of a pixel into its sums; returns the rays traced for it.
    pub(super) fn sample(&self, pixel: [u32; 2], sample: u32, sums: &mut Sums) -> u64 {
        let begun = self.begin(pixel, sample, 0, sums);
        self.finish(&mut vec![begun], std::slice::from_mut(sums))
    }

    /// Begins a sample of the pixel at a place of its cell, whose sums hear what the camera ray meets.
    fn begin(&self, [x, y]: [u32; 2], sample: u32, place: usize, sums: &mut Sums) -> Begun {
        let number = y * self.settings.width + x;
        let ([dx, dy], weight) = placed(self.filter, &self.transport.sampler, number, sample);
        let position = [f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy];
        let ray = if self.view.has_lens() {
            self.view.ray_through_lens(position, self.transport.sampler.pair(number, sample, LENS))
        } else {
            self.view.ray(position)
        };
        let time = if self.moves { self.transport.sampler.single(number, sample, TIME) } else { 0.0 };
        let start = Start { ray, cone: self.view.cone(position, sample), time, pixel: number, sample };
        let hit = if self.tiling.has_guides() {
            let (hit, guide) = self.guide(&start);
            sums.guide.push_sample(sample, guide);
            hit
        } else {
            self.transport.tracer.closest_hit(&ray, &mut self.transport.camera_query(&start))
        };
        Begun { start, hit, place, weight }
    }

    /// Finishes samples, in order, into the sums of their cell; returns the rays traced for them.
    fn finish(&self, begun: &mut Vec<Begun>, sums: &mut [Sums]) -> u64 {
        let mut n_rays = 0;
        let lights = self.transport.samples(begun.iter().map(|begun| (begun.start, begun.hit)));
        for (Begun { start, place, weight, .. }, light) in begun.drain(..).zip(lights) {
            sums[place].pixel.push_sample(start.sample, Pixel::weighed(light.radiance, weight));
            n_rays += light.n_rays;
        }
        n_rays
    }

    /// What a camera ray meets first, and its properties.
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
            // A light reflects nothing, and has no number among the instances.
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

/// Where a sample lies from the centre of the pixel of that number, in pixels, and its weight.
pub(super) fn placed(filter: &FilterSampler, sampler: &Sampler, pixel: u32, sample: u32) -> ([f64; 2], f32) {
    filter.place(sampler.pair(pixel, sample, PIXEL_POSITION))
}

/// A sample whose camera ray has been traced.
struct Begun {
    start: Start,
    hit: Option<Hit>,
    /// Of its pixel in the cell.
    place: usize,
    /// What its light counts for in the pixel.
    weight: f32,
}

/// A query that counts, and asks `inner` about hits.
struct Counted<Q> {
    inner: Q,
    counts: Counts,
}

impl<Q: Query> Query for Counted<Q> {
    const MAY_REJECT: bool = Q::MAY_REJECT;

    fn boxes(&mut self, n: u32) {
        self.counts.boxes(n);
    }

    fn triangles(&mut self, n: u32) {
        self.counts.triangles(n);
    }

    fn time(&self) -> f32 {
        self.inner.time()
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.inner.accepts(hit)
    }
}
