//! Samples of all pixels, tile by tile.

mod tiles;

use std::f64::consts::SQRT_2;
use std::fmt;
use std::ops::Range;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use canted_film::{Aov, Film, FilterSampler, Sums, Tile};
use canted_scene::{Camera, Scene};
use canted_trace::Intersect;

use crate::integrate::{Method, Transport};
use crate::times::StageTimes;
use crate::{CameraError, HitFilter, Integrator, LightSampler, Lights, Sampler, Settings, Surfaces, View};
#[cfg(feature = "gpu")]
pub(crate) use tiles::Worker;
use tiles::{Batch, TileRenderer};
pub(crate) use tiles::{RenderTiles, Schedule, sample_offset};

/// Callbacks of a render, called from any thread, and a flag that cancels it.
#[derive(Clone, Copy)]
pub struct Monitor<'a> {
    /// Receives the number of finished tiles and of all tiles.
    pub progress: &'a (dyn Fn(usize, usize) + Sync),
    /// Receives each tile as soon as it is finished.
    pub finished: &'a (dyn Fn(&Tile) + Sync),
    /// Cancels the render once it is set: on the CPU after the samples that were begun, on a GPU after the current dispatch.
    pub cancel: &'a AtomicBool,
    /// Receives what threads of the CPU spend their time on.
    pub times: Option<&'a StageTimes>,
}

impl<'a> Monitor<'a> {
    /// Calls nothing.
    #[must_use]
    pub fn quiet(cancel: &'a AtomicBool) -> Self {
        Self { progress: &|_, _| {}, finished: &|_| {}, cancel, times: None }
    }
}

/// Renders `scene` in the caller's thread pool.
///
/// `progress` receives, from any thread, the number of finished tiles and of all tiles; setting `cancel` stops the render.
/// The film has the same bits for any number of threads and any tile size.
///
/// With [`Settings::noise`], cells of 8 x 8 pixels stop at 16 samples, or at a power of two above, once the root mean
/// square of their relative standard errors ([`canted_film::Pixel::squared_error`]) is at most that value, and half of
/// the samples predicted it. [`Film::error`] is the error that the picture reached.
///
/// # Errors
/// [`RenderError`] for an invalid camera or invalid settings, or if the render was cancelled.
pub fn render(
    scene: &Scene,
    bvh: &dyn Intersect,
    camera: &Camera,
    settings: &Settings,
    progress: &(dyn Fn(usize, usize) + Sync),
    cancel: &AtomicBool,
) -> Result<Film, RenderError> {
    resume(scene, bvh, camera, settings, Vec::new(), &Monitor { progress, ..Monitor::quiet(cancel) })
}

/// [`render`] for the tiles that are not in `done`, which an earlier call with the same arguments finished.
///
/// # Errors
/// Those of [`render`], and [`RenderError::Tile`] for a tile of another picture.
pub fn resume(
    scene: &Scene,
    bvh: &dyn Intersect,
    camera: &Camera,
    settings: &Settings,
    done: Vec<Tile>,
    monitor: &Monitor,
) -> Result<Film, RenderError> {
    resume_with(&Surfaces::with_lod(scene, settings.lod), bvh, camera, settings, done, monitor)
}

/// [`resume`] with prepared surfaces, whose [`Lod`](crate::Lod) must be that of the settings.
///
/// # Errors
/// Those of [`resume`].
pub fn resume_with(
    surfaces: &Surfaces,
    bvh: &dyn Intersect,
    camera: &Camera,
    settings: &Settings,
    done: Vec<Tile>,
    monitor: &Monitor,
) -> Result<Film, RenderError> {
    let rendering = Rendering::new(surfaces.scene(), bvh, surfaces, camera, settings)?;
    let schedule = Schedule::new(settings.tiling(), done, monitor)?;
    rendering.with_tiles(|tiles| {
        rayon::in_place_scope(|scope| schedule.spawn_cpu_workers(scope, tiles));
    });
    Ok(schedule.into_film()?.0)
}

/// The validated inputs of a picture.
pub(crate) struct Rendering<'a> {
    scene: &'a Scene,
    bvh: &'a dyn Intersect,
    surfaces: &'a Surfaces<'a>,
    pub(crate) view: View,
    pub(crate) filter: FilterSampler,
    settings: &'a Settings,
    pub(crate) ao_radius: f64,
    /// Built on first use.
    light_sampler: OnceLock<LightSampler<'a>>,
}

impl<'a> Rendering<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        bvh: &'a dyn Intersect,
        surfaces: &'a Surfaces<'a>,
        camera: &Camera,
        settings: &'a Settings,
    ) -> Result<Self, RenderError> {
        check(settings)?;
        let ao_radius = ao_radius(scene, settings);
        let view = View::new(camera, settings.width, settings.height).map_err(RenderError::Camera)?;
        let filter = FilterSampler::new(settings.filter)
            .ok_or(RenderError::FilterRadius { radius: settings.filter.radius() })?;
        Ok(Self { scene, bvh, surfaces, view, filter, settings, ao_radius, light_sampler: OnceLock::new() })
    }

    /// The light sampler of the path integrator.
    pub(crate) fn light_sampler(&self) -> &LightSampler<'a> {
        self.light_sampler.get_or_init(|| LightSampler::new(Lights::new(self.scene), self.surfaces))
    }

    /// The weight of a sample by the filter.
    pub(crate) fn weights(&self) -> impl Fn([u32; 2], u32) -> f32 {
        let Settings { width, samples, seed, pattern, .. } = *self.settings;
        let sampler = Sampler::new(pattern, samples, seed);
        move |[x, y], sample| {
            if self.filter.is_signed() { sample_offset(&self.filter, &sampler, y * width + x, sample).1 } else { 1.0 }
        }
    }

    /// Calls `then` with the tile renderer of the scene.
    pub(crate) fn with_tiles<R>(&self, then: impl FnOnce(&dyn RenderTiles) -> R) -> R {
        self.with_batches(Batch::DEFAULT, then)
    }

    /// [`Rendering::with_tiles`] with other numbers of samples that are taken together.
    fn with_batches<R>(&self, batch: Batch, then: impl FnOnce(&dyn RenderTiles) -> R) -> R {
        let Settings { samples, bounces, seed, pattern, cull, clamp, energy_compensation, hemisphere, .. } =
            *self.settings;
        let transport = Transport {
            bvh: self.bvh,
            surfaces: self.surfaces,
            filter: HitFilter::new(self.surfaces).culling(cull, &self.view),
            sampler: Sampler::new(pattern, samples, seed),
            lights: Lights::new(self.scene),
            bounces,
            clamp: clamp.unwrap_or(f32::INFINITY),
            is_compensated: energy_compensation,
            hemisphere,
            keeps_first: self.settings.aovs.has_factors(),
            method: match self.settings.integrator {
                Integrator::Hybrid => Method::Hybrid { ao_radius: self.ao_radius },
                Integrator::Path => Method::Path(self.light_sampler()),
            },
        };
        then(&TileRenderer {
            transport: &transport,
            view: &self.view,
            has_motion: self.scene.has_motion(),
            filter: &self.filter,
            settings: self.settings,
            tiling: self.settings.tiling(),
            batch,
        })
    }
}

/// The radius of ambient occlusion in world units.
fn ao_radius(scene: &Scene, settings: &Settings) -> f64 {
    match settings.ao_radius {
        Some(radius) => f64::from(radius),
        // Not used, and the bounds of a scene take time.
        None if settings.integrator == Integrator::Path => f64::INFINITY,
        None => {
            let [x, y, z] = scene.bounds_world().extent();
            // A scene without extent has no occluders, so any positive radius serves.
            (0.1 * (x * x + y * y + z * z).sqrt()).max(f64::MIN_POSITIVE)
        }
    }
}

/// Rejects settings that no picture can have.
pub(crate) fn check(settings: &Settings) -> Result<(), RenderError> {
    let Settings { width, height, samples, ao_radius, part, noise, clamp, aovs, integrator, .. } = *settings;
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
    if let Some(clamp) = clamp.filter(|clamp| clamp.is_nan() || *clamp <= 0.0) {
        return Err(RenderError::Clamp { clamp });
    }
    if let Some(aov) = aovs.iter().find(|&aov| !integrator.aovs().contains(aov)) {
        return Err(RenderError::Aov { aov, integrator });
    }
    match ao_radius {
        Some(radius) if radius.is_nan() || radius <= 0.0 => Err(RenderError::AoRadius { radius }),
        _ => Ok(()),
    }
}

/// Samples after which the error of a cell is estimated first; then at each power of two.
const FIRST_ESTIMATE: u32 = 8;

/// Decides how many samples the pixels of a cell take.
pub(crate) struct Adaptive {
    /// The samples to take next.
    pub(crate) next: Range<u32>,
    end: u32,
    /// The error after half of the samples; infinite at first.
    previous: f64,
}

impl Adaptive {
    pub(crate) fn new(settings: &Settings) -> Self {
        let Range { start, end } = settings.range();
        let first = if settings.noise.is_some() { FIRST_ESTIMATE.min(end) } else { end };
        Self { next: start..first, end, previous: f64::INFINITY }
    }

    /// Continues after the samples of `next` were added to the sums of the cell's pixels; returns whether there are more.
    pub(crate) fn advance(&mut self, settings: &Settings, sums: &[Sums]) -> bool {
        if self.next.end == self.end {
            return false;
        }
        if let Some(noise) = settings.noise {
            let error = error(sums);
            // Two estimates must agree: the error of half the samples, scaled, must be low enough too.
            if error.max(self.previous / SQRT_2) <= f64::from(noise) {
                return false;
            }
            self.previous = error;
        }
        self.next = self.next.end..self.next.end.saturating_mul(2).min(self.end);
        true
    }
}

/// Root mean square of the pixels' errors.
fn error(sums: &[Sums]) -> f64 {
    let n = sums.len() as f64;
    (sums.iter().map(|sums| sums.pixel.total().squared_error()).sum::<f64>() / n).sqrt()
}

/// Why a picture was not rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RenderError {
    /// The picture has no pixel, or more than 2³² - 1.
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// [`crate::Settings::samples`] is zero.
    NoSamples,
    /// [`crate::Settings::part`] is empty, or exceeds the samples of the picture.
    Part {
        /// The first, and one past the last.
        part: [u32; 2],
        /// Samples per pixel of the picture.
        samples: u32,
    },
    /// [`crate::Settings::noise`] is not positive.
    Noise {
        /// The error to reach.
        noise: f32,
    },
    /// [`crate::Settings::noise`] and [`crate::Settings::part`] are both set.
    NoiseOfPart,
    /// A finished tile does not belong to this picture.
    Tile {
        /// Its number.
        number: usize,
    },
    /// [`crate::Settings::ao_radius`] is not positive.
    AoRadius {
        /// The radius.
        radius: f32,
    },
    /// [`crate::Settings::clamp`] is not positive.
    Clamp {
        /// The limit.
        clamp: f32,
    },
    /// The integrator does not compute one of [`crate::Settings::aovs`].
    Aov {
        /// The AOV.
        aov: Aov,
        /// The integrator.
        integrator: Integrator,
    },
    /// The radius of the pixel filter is not finite and positive.
    FilterRadius {
        /// The radius in pixels.
        radius: f32,
    },
    /// The camera is invalid.
    Camera(CameraError),
    /// [`crate::Monitor::cancel`] was set.
    Cancelled,
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { width, height } => write!(f, "a picture of {width} x {height} pixels cannot be rendered"),
            Self::Part { part: [start, end], samples } => {
                write!(f, "samples {start}..{end} are not a part of 0..{samples}")
            }
            Self::Noise { noise } => write!(f, "noise {noise} is not an error above zero"),
            Self::NoiseOfPart => write!(f, "a noise target and a part of the samples exclude each other"),
            Self::Tile { number } => write!(f, "tile {number} does not belong to this picture"),
            Self::NoSamples => write!(f, "a picture needs at least one sample per pixel"),
            Self::Clamp { clamp } => write!(f, "a limit of radiance of {clamp} is not above zero"),
            Self::AoRadius { radius } => write!(f, "ambient occlusion radius {radius} is not above zero"),
            Self::Aov { aov, integrator } => {
                write!(f, "the channel {} is not one of the integrator {}", aov.name(), integrator.name())
            }
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

#[cfg(test)]
mod tests {
    use canted_film::{Aovs, Tile};

    use super::*;
    use crate::times::Times;
    use crate::{SceneBvh, SceneBvhConfig, frame};

    /// Batches from a single sample to more than a cell has, in which slices of rays are long enough to walk in groups.
    #[test]
    fn batches_change_no_tile() {
        const SIZE: [u32; 2] = [13, 8];
        let scene = canted_scene::builtin();
        let bvh = SceneBvh::build(&scene, &SceneBvhConfig::default()).unwrap();
        let camera = frame(&scene, &bvh, f64::from(SIZE[0]) / f64::from(SIZE[1]));
        let aovs = [Aovs::NONE, Aovs::NONE.with(Aov::Normal).with(Aov::Direct)];
        for (integrator, aovs) in [Integrator::Hybrid, Integrator::Path].into_iter().zip(aovs) {
            let settings =
                Settings { width: SIZE[0], height: SIZE[1], integrator, samples: 9, aovs, ..Settings::default() };
            let tile = |seed, rays, paths| -> Tile {
                let settings = Settings { seed, ..settings };
                let surfaces = Surfaces::with_lod(&scene, settings.lod);
                let rendering = Rendering::new(&scene, &bvh, &surfaces, &camera, &settings).unwrap();
                rendering
                    .with_batches(Batch { rays, paths }, |tiles| tiles.tile(0, &mut Times::new(), &|| false).unwrap())
            };
            let Batch { rays, paths } = Batch::DEFAULT;
            let want = tile(0, rays, paths);
            for [rays, paths] in [[1, 1], [300, 7], [1 << 20, 1 << 20]] {
                assert!(tile(0, rays, paths) == want, "{integrator:?} {rays} {paths}");
            }
            assert!(tile(1, rays, paths) != want, "the comparison sees other samples");
        }
    }
}
