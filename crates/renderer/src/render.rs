use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use canted_scene::{Camera, Scene};
use canted_trace::Query;
use rayon::prelude::*;

use crate::film::Pixel;
use crate::integrate::{Hybrid, environment_of};
use crate::{CameraError, Film, FilterSampler, Masked, Sampler, Settings, Surfaces, Tracer, View, mask};

/// Dimension of the sampler that places a sample in its pixel.
const PIXEL_POSITION: u32 = 0;

/// Renders `scene` by the hybrid integrator in the caller's thread pool.
///
/// `progress` hears, from any thread, how many tiles of how many are done; `cancel` stops the work within a row of a
/// tile once it is set. The film is the same bits for any number of threads and any tile size.
///
/// # Errors
/// [`RenderError`] where camera or settings make no picture, or the work was cancelled.
pub fn render<T: Tracer>(
    scene: &Scene,
    tracer: &T,
    camera: &Camera,
    settings: &Settings,
    progress: &(dyn Fn(usize, usize) + Sync),
    cancel: &AtomicBool,
) -> Result<Film, RenderError> {
    let ao_radius = checked_ao_radius(scene, settings)?;
    let view = View::new(camera, settings.width, settings.height).map_err(RenderError::Camera)?;
    let filter =
        FilterSampler::new(settings.filter).ok_or(RenderError::FilterRadius { radius: settings.filter.radius() })?;
    let surfaces = Surfaces::new(scene);
    let work = Work { scene, tracer, surfaces: &surfaces, view, filter, settings, ao_radius, progress, cancel };
    // Masks cost a texture lookup a hit: a scene without them runs code that has none.
    if mask::is_needed(scene) { work.run(Masked::new(&surfaces, ())) } else { work.run(()) }
}

fn checked_ao_radius(scene: &Scene, settings: &Settings) -> Result<f64, RenderError> {
    let Settings { width, height, samples, ao_radius, .. } = *settings;
    // Pixels are numbered in 32 bits.
    if u64::from(width) * u64::from(height) > u64::from(u32::MAX) || width == 0 || height == 0 {
        return Err(RenderError::Size { width, height });
    }
    if samples == 0 {
        return Err(RenderError::NoSamples);
    }
    match ao_radius {
        Some(radius) if radius > 0.0 => Ok(f64::from(radius)),
        Some(radius) => Err(RenderError::AoRadius { radius }),
        None => {
            let [x, y, z] = scene.bounds_world().extent();
            // A scene of no extent has nothing to occlude; any radius serves.
            Ok((0.1 * (x * x + y * y + z * z).sqrt()).max(f64::MIN_POSITIVE))
        }
    }
}

struct Work<'a, T> {
    scene: &'a Scene,
    tracer: &'a T,
    surfaces: &'a Surfaces<'a>,
    view: View,
    filter: FilterSampler,
    settings: &'a Settings,
    ao_radius: f64,
    progress: &'a (dyn Fn(usize, usize) + Sync),
    cancel: &'a AtomicBool,
}

/// A rectangle of pixels and what became of it.
struct Tile {
    x: u32,
    y: u32,
    rows: Vec<Vec<Pixel>>,
    n_rays: u64,
}

impl<T: Tracer> Work<'_, T> {
    fn run<Q: Query + Clone + Sync>(&self, query: Q) -> Result<Film, RenderError> {
        let Settings { width, height, samples, bounces, seed, pattern, .. } = *self.settings;
        let integrator = Hybrid {
            tracer: self.tracer,
            surfaces: self.surfaces,
            query,
            sampler: Sampler::new(pattern, samples, seed),
            lights: &self.scene.lights,
            environment: environment_of(self.scene),
            bounces,
            ao_radius: self.ao_radius,
        };
        let side = self.settings.tile.max(1);
        let corners: Vec<[u32; 2]> = (0..height.div_ceil(side))
            .flat_map(|j| (0..width.div_ceil(side)).map(move |i| [i * side, j * side]))
            .collect();
        let n_done = AtomicUsize::new(0);
        let tiles: Option<Vec<Tile>> = corners
            .par_iter()
            .map(|&[x, y]| {
                let tile = self.tile(&integrator, x, y)?;
                (self.progress)(n_done.fetch_add(1, Ordering::Relaxed) + 1, corners.len());
                Some(tile)
            })
            .collect();

        let mut film = Film::new(width, height);
        for tile in tiles.ok_or(RenderError::Cancelled)? {
            film.count_rays(tile.n_rays);
            for (y, row) in (tile.y..).zip(&tile.rows) {
                film.put(tile.x, y, row);
            }
        }
        Ok(film)
    }

    /// Renders the tile whose top left pixel is (`x`, `y`); `None` once the work is cancelled.
    fn tile<Q: Query + Clone>(&self, integrator: &Hybrid<'_, T, Q>, x: u32, y: u32) -> Option<Tile> {
        let Settings { width, height, tile: side, .. } = *self.settings;
        let end = |start: u32, limit: u32| start.saturating_add(side.max(1)).min(limit);
        let mut tile = Tile { x, y, rows: Vec::new(), n_rays: 0 };
        for row in y..end(y, height) {
            if self.cancel.load(Ordering::Relaxed) {
                return None;
            }
            let pixels = (x..end(x, width)).map(|column| self.pixel(integrator, column, row, &mut tile.n_rays));
            tile.rows.push(pixels.collect());
        }
        Some(tile)
    }

    fn pixel<Q: Query + Clone>(&self, integrator: &Hybrid<'_, T, Q>, x: u32, y: u32, n_rays: &mut u64) -> Pixel {
        let number = y * self.settings.width + x;
        let mut pixel = Pixel::default();
        for sample in 0..self.settings.samples {
            let ([dx, dy], weight) = self.filter.place(integrator.sampler.pair(number, sample, PIXEL_POSITION));
            let ray = self.view.ray([f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy]);
            let light = integrator.sample(ray, number, sample);
            pixel.add(light.radiance.map(|x| weight * x));
            *n_rays += light.n_rays;
        }
        pixel
    }
}

/// Why there is no picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RenderError {
    /// The picture has no pixel, or more than 2³² - 1.
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// No sample per pixel was asked for.
    NoSamples,
    /// The radius of ambient occlusion is not above zero.
    AoRadius {
        /// The radius.
        radius: f32,
    },
    /// The radius of the pixel filter is not finite and above zero.
    FilterRadius {
        /// The radius in pixels.
        radius: f32,
    },
    /// The camera cannot be used.
    Camera(CameraError),
    /// The caller's flag stopped the work.
    Cancelled,
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { width, height } => write!(f, "a picture of {width} x {height} pixels cannot be rendered"),
            Self::NoSamples => write!(f, "0 samples per pixel make no picture"),
            Self::AoRadius { radius } => write!(f, "ambient occlusion radius {radius} is not above zero"),
            Self::FilterRadius { radius } => write!(f, "pixel filter radius {radius} is not finite and above zero"),
            Self::Camera(error) => error.fmt(f),
            Self::Cancelled => write!(f, "rendering was cancelled"),
        }
    }
}

impl std::error::Error for RenderError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        if let Self::Camera(error) = self { Some(error) } else { None }
    }
}
