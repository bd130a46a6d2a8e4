use std::f64::consts::SQRT_2;
use std::ops::Range;

use canted_trace::{Counts, Hit, Query};

use crate::film::{Dyadic, total};
use crate::integrate::{Start, Transport};
use crate::mask::Numbered;
use crate::{Aov, FilterSampler, Guide, Pixel, Settings, Tracer, View, film::Block};

/// Dimension of the sampler that places a sample in its pixel.
const PIXEL_POSITION: u32 = 0;

/// Dimension that chooses a sample's time, apart from those that integrators count up.
const TIME: u32 = u32::MAX;

/// Dimension that places a sample on the lens, likewise.
const LENS: u32 = u32::MAX - 1;

/// Pixels along the side of a cell: neighbours that stop together, wherever tiles end.
pub(crate) const CELL: u32 = 8;

/// Samples after which the error of a cell is looked at for the first time; then at each power of two.
const FIRST_LOOK: u32 = 8;

/// A rectangle of pixels whose samples are summed.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Its place, row by row from the top left.
    pub number: usize,
    /// Sums of each pixel, row by row; in a part of the samples one for each block.
    pub pixels: Vec<Pixel>,
    /// The same of guides; empty where none were asked for.
    pub guides: Vec<Guide>,
    /// Rays traced.
    pub n_rays: u64,
}

/// How a picture is cut into tiles, and what each pixel keeps.
#[derive(Clone, Copy)]
pub(crate) struct Layout {
    picture: [u32; 2],
    side: u32,
    columns: u32,
    rows: u32,
    n_sums: usize,
    /// Whether each block of the samples is kept by itself.
    is_part: bool,
    is_guided: bool,
}

impl Layout {
    pub(crate) fn new(settings: &Settings) -> Self {
        let Settings { width, height, tile, aovs, .. } = *settings;
        // Tiles are made of whole cells; the greatest side that can be rounded up is far above any picture.
        let side = tile.clamp(1, 1 << 16).next_multiple_of(CELL);
        let n_sums = settings.part.map_or(1, |_| Block::of(settings.range()).len());
        let [columns, rows] = [width, height].map(|n| n.div_ceil(side));
        Self {
            picture: [width, height],
            side,
            columns,
            rows,
            n_sums,
            is_part: settings.part.is_some(),
            is_guided: !aovs.is_empty(),
        }
    }

    pub(crate) fn n_tiles(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Sums kept for each pixel.
    pub(crate) fn n_sums(&self) -> usize {
        self.n_sums
    }

    pub(crate) fn is_guided(&self) -> bool {
        self.is_guided
    }

    /// Column and row of the top left pixel.
    #[expect(clippy::cast_possible_truncation, reason = "quotient and remainder by a u32 of a number below 2^32")]
    pub(crate) fn corner(&self, number: usize) -> [u32; 2] {
        let columns = self.columns as usize;
        [(number % columns) as u32 * self.side, (number / columns) as u32 * self.side]
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self, number: usize) -> [u32; 2] {
        let corner = self.corner(number);
        std::array::from_fn(|k| self.side.min(self.picture[k] - corner[k]))
    }

    /// An empty tile of this number.
    pub(crate) fn tile(&self, number: usize) -> Tile {
        let [width, height] = self.size(number);
        let n = width as usize * height as usize * self.n_sums;
        let n_guides = if self.is_guided { n } else { 0 };
        Tile { number, pixels: vec![Pixel::default(); n], guides: vec![Guide::default(); n_guides], n_rays: 0 }
    }

    /// The pixels of each cell of a tile, by column and row in it.
    pub(crate) fn cells(&self, number: usize) -> impl Iterator<Item = Vec<[u32; 2]>> + use<> {
        let [width, height] = self.size(number);
        cells(height)
            .flat_map(move |y| cells(width).map(move |x| (y.clone(), x)))
            .map(|(y, x)| y.flat_map(|y| x.clone().map(move |x| [x, y])).collect())
    }

    /// Puts what is kept of the sums of a cell's pixels into a tile.
    pub(crate) fn keep(&self, pixels: &[[u32; 2]], sums: &[Sums], tile: &mut Tile) {
        let [width, _] = self.size(tile.number);
        for ([x, y], sums) in pixels.iter().zip(sums) {
            let first = (y * width + x) as usize * self.n_sums;
            self.keep_values(&sums.pixel, &mut tile.pixels[first..]);
            if self.is_guided {
                self.keep_values(&sums.guide, &mut tile.guides[first..]);
            }
        }
    }

    /// Puts what is kept of a pixel's sums to the front of `place`.
    fn keep_values<S: Copy + Default + std::ops::Add<Output = S>>(&self, sums: &Dyadic<S>, place: &mut [S]) {
        if !self.is_part {
            place[0] = total(sums.values());
            return;
        }
        for (place, value) in place.iter_mut().zip(sums.values()) {
            *place = value;
        }
    }

    /// Whether `tile` has the sums that this picture keeps.
    pub(crate) fn fits(&self, tile: &Tile) -> bool {
        if tile.number >= self.n_tiles() {
            return false;
        }
        let [width, height] = self.size(tile.number).map(|n| n as usize);
        let n = width * height * self.n_sums;
        tile.pixels.len() == n && tile.guides.len() == if self.is_guided { n } else { 0 }
    }
}

/// What all tiles of a picture share.
pub(super) struct Work<'a, T, Q> {
    pub(super) transport: &'a Transport<'a, T, Q>,
    pub(super) view: &'a View,
    /// Whether samples have times of their own.
    pub(super) moves: bool,
    pub(super) filter: &'a FilterSampler,
    pub(super) settings: &'a Settings,
    pub(super) layout: Layout,
}

/// The sums of one pixel while its samples are taken.
#[derive(Clone, Default)]
pub(crate) struct Sums {
    pub(crate) pixel: Dyadic<Pixel>,
    pub(crate) guide: Dyadic<Guide>,
}

/// How far the samples of a cell have got.
pub(crate) struct Course {
    /// The samples to take now.
    pub(crate) next: Range<u32>,
    /// One past the last that there are.
    last: u32,
    /// What half of the samples said before them; nothing at first.
    before: f64,
}

impl Course {
    pub(crate) fn new(settings: &Settings) -> Self {
        let Range { start, end: last } = settings.range();
        let end = if settings.noise.is_some() { FIRST_LOOK.min(last) } else { last };
        Self { next: start..end, last, before: f64::INFINITY }
    }

    /// Goes on after `next` was taken, into the sums of the cell's pixels; whether there is more to take.
    pub(crate) fn goes_on(&mut self, settings: &Settings, sums: &[Sums]) -> bool {
        if self.next.end == self.last {
            return false;
        }
        if let Some(noise) = settings.noise {
            let now = error(sums);
            // Luck must strike twice: the first half, by itself, must have foretold that this many are enough.
            if now.max(self.before / SQRT_2) <= f64::from(noise) {
                return false;
            }
            self.before = now;
        }
        self.next = self.next.end..self.next.end.saturating_mul(2).min(self.last);
        true
    }
}

impl<T: Tracer, Q: Numbered> Work<'_, T, Q> {
    /// Renders a tile; `None` once `stop` says so, which is asked at every pixel.
    pub(super) fn tile(&self, number: usize, stop: &dyn Fn() -> bool) -> Option<Tile> {
        let [left, top] = self.layout.corner(number);
        let mut tile = self.layout.tile(number);
        let mut sums = vec![Sums::default(); (CELL * CELL) as usize];
        for pixels in self.layout.cells(number) {
            let positions = pixels.iter().map(|&[x, y]| [left + x, top + y]);
            self.cell(positions, &mut sums, &mut tile.n_rays, stop)?;
            self.layout.keep(&pixels, &sums, &mut tile);
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
            sums.pixel.clear();
            sums.guide.clear();
        }
        let mut course = Course::new(self.settings);
        loop {
            for ([x, y], sums) in pixels.clone().zip(&mut *sums) {
                if stop() {
                    return None;
                }
                for sample in course.next.clone() {
                    *n_rays += self.sample([x, y], sample, sums);
                }
            }
            if !course.goes_on(self.settings, sums) {
                return Some(());
            }
        }
    }

    /// Takes one sample; returns the rays traced for it.
    pub(super) fn sample(&self, [x, y]: [u32; 2], sample: u32, sums: &mut Sums) -> u64 {
        let number = y * self.settings.width + x;
        let square = self.transport.sampler.pair(number, sample, PIXEL_POSITION);
        let ([dx, dy], weight) = self.filter.place(square);
        let position = [f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy];
        let ray = if self.view.has_lens() {
            self.view.ray_through_lens(position, self.transport.sampler.pair(number, sample, LENS))
        } else {
            self.view.ray(position)
        };
        let time = if self.moves { self.transport.sampler.single(number, sample, TIME) } else { 0.0 };
        let start = Start { ray, cone: self.view.cone(position, sample), time, pixel: number, sample };
        let hit = if self.layout.is_guided {
            let (hit, guide) = self.guide(&start);
            sums.guide.push_sample(sample, guide);
            hit
        } else {
            self.transport.tracer.closest_hit(&ray, &mut self.transport.camera_query(&start))
        };
        let light = self.transport.sample(&start, hit);
        sums.pixel.push_sample(sample, Pixel::of(light.radiance.map(|x| weight * x)));
        light.n_rays
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

/// The cells along `n` pixels.
fn cells(n: u32) -> impl Iterator<Item = Range<u32>> + Clone {
    (0..n).step_by(CELL as usize).map(move |start| start..(start + CELL).min(n))
}

/// Root of the mean of the pixels' squared errors.
fn error(sums: &[Sums]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "pixels of a cell")]
    let n = sums.len() as f64;
    (sums.iter().map(|sums| sums.pixel.total().squared_error()).sum::<f64>() / n).sqrt()
}

/// A query that counts, and asks `inner` about hits.
struct Counted<Q> {
    inner: Q,
    counts: Counts,
}

impl<Q: Query> Query for Counted<Q> {
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
