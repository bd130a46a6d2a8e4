//! Samples of all pixels, tile by tile.

mod course;
mod error;
mod tile;

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use canted_film::{Film, FilterSampler, Sums, Tile, Tiling};
use canted_scene::{Camera, Scene};
use rayon::prelude::*;

use crate::integrate::{Method, Transport};
use crate::query::RayKeyed;
use crate::{Integrator, LightSampler, Lights, Masked, Sampler, Settings, Surfaces, Tracer, View, mask};
pub(crate) use course::Course;
pub use error::RenderError;
use tile::Work;

/// What a render tells its caller while it works, from any thread.
#[derive(Clone, Copy)]
pub struct Monitor<'a> {
    /// Hears how many tiles of how many are done.
    pub progress: &'a (dyn Fn(usize, usize) + Sync),
    /// Sees each tile as soon as it is done.
    pub finished: &'a (dyn Fn(&Tile) + Sync),
    /// Stops the work once it is set, within the samples of a pixel or those that are taken side by side.
    pub cancel: &'a AtomicBool,
}

/// Renders `scene` by the integrator of the settings in the caller's thread pool.
///
/// `progress` hears, from any thread, how many tiles of how many are done; `cancel` stops the work soon once it is set.
/// The film is the same bits for any number of threads and any tile size.
///
/// With [`Settings::noise`] pixels stop in cells of 8 x 8, at 16 samples or at a power of two above, as soon as the
/// root mean square over the cell of the relative standard error of their luminance ([`Pixel::squared_error`]) is at
/// most that, and half of the samples foretold it; all stop at [`Settings::samples`]. [`Film::error`] is what the
/// picture reached.
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
    resume(scene, tracer, camera, settings, Vec::new(), &Monitor { progress, finished: &|_| {}, cancel })
}

/// Renders as [`render`] does what is not in `done`: tiles that an earlier call with the same arguments finished.
///
/// # Errors
/// As [`render`], and [`RenderError::Tile`] for a tile that cannot be of this picture.
pub fn resume<T: Tracer>(
    scene: &Scene,
    tracer: &T,
    camera: &Camera,
    settings: &Settings,
    done: Vec<Tile>,
    monitor: &Monitor,
) -> Result<Film, RenderError> {
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let rendering = Rendering::new(scene, tracer, &surfaces, camera, settings)?;
    // Masks cost a texture lookup a hit: a scene without them runs code that has none.
    if mask::is_needed(scene) {
        rendering.run(Masked::new(&surfaces, ()), done, monitor)
    } else {
        rendering.run((), done, monitor)
    }
}

fn checked_ao_radius(scene: &Scene, settings: &Settings) -> Result<f64, RenderError> {
    let Settings { width, height, samples, ao_radius, part, noise, .. } = *settings;
    // Pixels are numbered in 32 bits.
    if u64::from(width) * u64::from(height) > u64::from(u32::MAX) || width == 0 || height == 0 {
        return Err(RenderError::Size { width, height });
    }
    if samples == 0 {
        return Err(RenderError::NoSamples);
    }
    if let Some(part) = part.filter(|&[start, end]| start >= end || end > samples) {
        return Err(RenderError::Part { part, samples });
    }
    match noise {
        Some(_) if part.is_some() => return Err(RenderError::NoiseOfPart),
        Some(noise) if noise.is_nan() || noise <= 0.0 => return Err(RenderError::Noise { noise }),
        _ => {}
    }
    match ao_radius {
        Some(radius) if radius > 0.0 => Ok(f64::from(radius)),
        Some(radius) => Err(RenderError::AoRadius { radius }),
        // Asked by no one, and the bounds of a scene take their time.
        None if settings.integrator == Integrator::Path => Ok(f64::INFINITY),
        None => {
            let [x, y, z] = scene.bounds_world().extent();
            // A scene of no extent has nothing to occlude; any radius serves.
            Ok((0.1 * (x * x + y * y + z * z).sqrt()).max(f64::MIN_POSITIVE))
        }
    }
}

/// Makes the tile of a number; `None` once the other argument says to stop.
pub(crate) type TileMaker<'a> = dyn Fn(usize, &dyn Fn() -> bool) -> Option<Tile> + Sync + 'a;

/// What a picture is made of, checked.
pub(crate) struct Rendering<'a, T> {
    scene: &'a Scene,
    tracer: &'a T,
    surfaces: &'a Surfaces<'a>,
    pub(crate) view: View,
    pub(crate) filter: FilterSampler,
    settings: &'a Settings,
    pub(crate) ao_radius: f64,
    /// Made when first asked for.
    light_sampler: OnceLock<LightSampler<'a>>,
}

impl<'a, T: Tracer> Rendering<'a, T> {
    pub(crate) fn new(
        scene: &'a Scene,
        tracer: &'a T,
        surfaces: &'a Surfaces<'a>,
        camera: &Camera,
        settings: &'a Settings,
    ) -> Result<Self, RenderError> {
        let ao_radius = checked_ao_radius(scene, settings)?;
        let view = View::new(camera, settings.width, settings.height).map_err(RenderError::Camera)?;
        let filter = FilterSampler::new(settings.filter)
            .ok_or(RenderError::FilterRadius { radius: settings.filter.radius() })?;
        Ok(Self { scene, tracer, surfaces, view, filter, settings, ao_radius, light_sampler: OnceLock::new() })
    }

    /// What the path integrator samples of the lights.
    pub(crate) fn light_sampler(&self) -> &LightSampler<'a> {
        self.light_sampler.get_or_init(|| LightSampler::new(Lights::new(self.scene), self.surfaces))
    }

    /// Takes a sample of a pixel into its sums; returns the rays traced for it.
    pub(crate) fn take(&self, at: [u32; 2], sample: u32, sums: &mut Sums) -> u64 {
        if mask::is_needed(self.scene) {
            self.with_work(Masked::new(self.surfaces, ()), |work| work.sample(at, sample, sums))
        } else {
            self.with_work((), |work| work.sample(at, sample, sums))
        }
    }

    /// What tells the weight of a sample of a pixel, by the filter.
    pub(crate) fn weights(&self) -> impl Fn([u32; 2], u32) -> f32 {
        let Settings { width, samples, seed, pattern, .. } = *self.settings;
        let sampler = Sampler::new(pattern, samples, seed);
        move |[x, y], sample| {
            if self.filter.is_signed() { tile::placed(&self.filter, &sampler, y * width + x, sample).1 } else { 1.0 }
        }
    }

    /// Hands out what makes tiles.
    pub(crate) fn with_tiles<R>(&self, then: impl FnOnce(&TileMaker<'_>) -> R) -> R {
        if mask::is_needed(self.scene) {
            self.with_work(Masked::new(self.surfaces, ()), |work| then(&|number, stop| work.tile(number, stop)))
        } else {
            self.with_work((), |work| then(&|number, stop| work.tile(number, stop)))
        }
    }

    fn with_work<Q: RayKeyed, R>(&self, query: Q, then: impl FnOnce(&Work<T, Q>) -> R) -> R {
        let Settings { samples, bounces, seed, pattern, .. } = *self.settings;
        let transport = Transport {
            tracer: self.tracer,
            surfaces: self.surfaces,
            query,
            sampler: Sampler::new(pattern, samples, seed),
            lights: Lights::new(self.scene),
            bounces,
            method: match self.settings.integrator {
                Integrator::Hybrid => Method::Hybrid { ao_radius: self.ao_radius },
                Integrator::Path => Method::Path(self.light_sampler()),
            },
        };
        then(&Work {
            transport: &transport,
            view: &self.view,
            moves: self.scene.has_motion(),
            filter: &self.filter,
            settings: self.settings,
            tiling: self.settings.tiling(),
        })
    }

    fn run<Q: RayKeyed + Sync>(&self, query: Q, done: Vec<Tile>, monitor: &Monitor) -> Result<Film, RenderError> {
        let tiling = self.settings.tiling();
        let slots = in_place(&tiling, done)?;
        let n_tiles = slots.len();
        let n_done = AtomicUsize::new(slots.iter().flatten().count());
        let tiles: Option<Vec<Tile>> = self.with_work(query, |work| {
            let render = |(number, slot): (usize, Option<Tile>)| {
                if slot.is_some() {
                    return slot;
                }
                let tile = work.tile(number, &|| monitor.cancel.load(Ordering::Relaxed))?;
                (monitor.finished)(&tile);
                (monitor.progress)(n_done.fetch_add(1, Ordering::Relaxed) + 1, n_tiles);
                Some(tile)
            };
            slots.into_par_iter().enumerate().map(render).collect()
        });
        Ok(tiling.film(&tiles.ok_or(RenderError::Cancelled)?))
    }
}

/// Finished tiles by number, with `None` for those that are missing.
pub(crate) fn in_place(tiling: &Tiling, done: Vec<Tile>) -> Result<Vec<Option<Tile>>, RenderError> {
    tiling.slots(done).map_err(|number| RenderError::Tile { number })
}
