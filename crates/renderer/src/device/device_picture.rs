//! Pictures rendered by a GPU, alone or together with the CPU.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use canted_film::{Aov, CELL, Film, Filter, Tile};
use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding, TracedScene, Variant, choice, wgsl};
use canted_scene::{Camera, Lobes, Scene};

use super::collector::{self, SampleCollector, SampleDispatcher};
use super::lights::{DeviceSky, SampledLights};
use super::picture::{self, Pace, PackedPicture};
use super::records::{self, LightKernels, RenderKernels};
use super::scene::PackedScene;
use super::streams::StreamKernels;
use super::sums::SumKernels;
use super::traced::{Traced, traced_frame, traced_scene};
use super::{DeviceError, DeviceFrames};
use crate::light::bounded;
use crate::render::{RenderTiles, Rendering, Schedule, Worker};
use crate::{Integrator, Lights, Monitor, SampleSums, SceneBvh, SceneLevels, Settings, Surfaces};

/// A film that a GPU and the CPU rendered together.
pub struct SharedFilm {
    /// The film.
    pub film: Film,
    /// Tiles that the GPU rendered in this call.
    pub n_tiles_of_device: usize,
    /// Why the GPU stopped before the end, if it did; the CPU rendered the rest.
    pub stopped: Option<GpuError>,
}

/// How the rays of a picture are traced where both is possible.
#[derive(Clone, Copy)]
struct Wanted {
    /// As streams.
    streams: bool,
    /// After so many rounds one kernel ends all samples.
    few_rounds: Option<u32>,
}

/// A scene and the settings of a picture on a GPU, ready to render.
pub struct DevicePicture<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) surfaces: &'a Surfaces<'a>,
    pub(super) settings: &'a Settings,
    /// The same picture on the CPU.
    pub(super) cpu: Rendering<'a>,
    pub(super) traced: Traced<'a>,
    pub(super) packed: PackedScene,
    sky: DeviceSky,
    /// The lights that the path integrator samples.
    sampled: Option<SampledLights>,
    picture: Buffer<PackedPicture>,
    filter_table: Option<Buffer<f32>>,
    /// The variant of the light kernel, but for how it finds first hits.
    pub(super) chosen: Variant,
    /// What of the scene and the settings prevents streams of rays; `None` if nothing does. A limit of the device may, too.
    no_streams: Option<&'static str>,
    n_exact_rays: AtomicU64,
    pace: Arc<Pace>,
    pub(super) kernels: RenderKernels,
    /// Instance and primitive at the center of each pixel, where a raster pass found them.
    pub(super) first_seen: Option<Buffer<[u32; 2]>>,
}

/// What kernels lack of [`canted_scene::Lobes`].
const LOBES: &str = "clear coats, sheen, anisotropy, thin films, colored reflections of dielectrics and absorption";

/// Whether lobes change the albedo that AOVs show.
fn changes_albedo(lobes: &Lobes) -> bool {
    let Lobes { specular_color, specular_color_texture, specular_texture, iridescence, .. } = lobes;
    *specular_color != [1.0; 3] || specular_color_texture.is_some() || specular_texture.is_some() || *iridescence > 0.0
}

/// Most rounds of streams, which [`no_streams`] names: rounds in which no sample is left cost dispatches, too.
const MOST_ROUNDS: u32 = 64;

/// Samples of a frame of a sequence up to which one kernel takes each with all its rays: streams of so few cost more in dispatches than they save (the Fox,
/// one sample of 200 x 112 pixels and four: 0.45 and 2.8 s, as streams 1.0 and 2.7 s; llvmpipe, loaded machine, 2026-11-29).
const SMALL_FRAME: u32 = 1 << 16;

/// Samples of a frame up to which one kernel traces what the first round of rays leaves, so that a frame takes at most 20 dispatches with its rebuild,
/// and two more for each of light, AOVs, light in parts and at the first surface that the device sums. That kernel decides rays exactly, so in larger
/// frames it would cost more than the dispatches of further rounds.
const MEDIUM_FRAME: u32 = 1 << 18;

/// Rounds of rays in such a frame.
const ROUNDS_OF_FRAME: u32 = 1;

/// Samples of a picture, those beside its edges included.
fn n_samples(settings: &Settings) -> u32 {
    n_groups(settings).saturating_mul(CELL * CELL)
}

/// How often the samples of a picture are shaded as streams.
fn n_rounds(scene: &Scene, settings: &Settings) -> u32 {
    // A ray from the camera, one from each vertex, and one that finds no further vertex.
    let n_rays = settings.bounces.saturating_add(2);
    match settings.integrator {
        Integrator::Path => n_rays,
        // Each listed light takes a round, and the onward ray goes with the last.
        Integrator::Hybrid => n_rays.saturating_mul(u32::try_from(scene.lights.len().max(1)).unwrap_or(u32::MAX)),
    }
}

/// Why the rays of a picture cannot be traced as streams, as far as device, scene and settings say; `None` if they can.
fn no_streams(gpu: &Gpu, (scene, traced): (&Scene, &TracedScene), settings: &Settings) -> Option<&'static str> {
    let reasons = [
        (traced.has_curves(), "curves or patches"),
        (n_rounds(scene, settings) > MOST_ROUNDS, "more than 64 rounds of rays"),
        (StreamKernels::max_groups(gpu, &Pace::default()) == 0, "the size of storage buffers"),
    ];
    reasons.into_iter().find(|(is_one, _)| *is_one).map(|(_, reason)| reason)
}

/// Work-groups that take all samples of a picture.
fn n_groups(settings: &Settings) -> u32 {
    let [columns, rows] = [settings.width, settings.height].map(|pixels| pixels.div_ceil(CELL));
    let samples = settings.range();
    columns.saturating_mul(rows).saturating_mul(samples.end.saturating_sub(samples.start))
}

/// The kernels of a picture as streams, whose samples one kernel ends after `few` rounds; `chosen` has the choices of its kernel for whole samples.
fn streams(
    gpu: &Gpu,
    chosen: &Variant,
    (scene, packed, traced): (&Scene, &PackedScene, &TracedScene),
    settings: &Settings,
    few: Option<u32>,
) -> Result<LightKernels, GpuError> {
    let integrator = match settings.integrator {
        Integrator::Path => choice::Integrator::Path,
        Integrator::Hybrid => choice::Integrator::Hybrid,
    };
    let masked = packed.masked(traced.has_masked());
    let n_rounds = (n_rounds(scene, settings), few);
    Ok(LightKernels::Streams(StreamKernels::new(gpu, traced, chosen, (integrator, masked), n_rounds)?))
}

impl<'a> DevicePicture<'a> {
    /// Uploads what the picture needs of the scene and its acceleration structure, and compiles kernels.
    ///
    /// # Errors
    /// Invalid settings, features that the kernels do not support, or too little memory on the device.
    pub fn new(
        gpu: &'a Gpu,
        surfaces: &'a Surfaces<'a>,
        bvh: &'a SceneBvh,
        camera: &Camera,
        settings: &'a Settings,
    ) -> Result<Self, DeviceError> {
        Self::over(gpu, surfaces, bvh, camera, settings, |scene| traced_scene(gpu, scene, bvh))
    }

    /// The same with other BVHs on the device, in as many levels as `structure`: those that `make` returns for the scene, such as
    /// [`built_scene`](crate::built_scene).
    ///
    /// # Errors
    /// As for [`DevicePicture::new`], and those of `make`.
    pub fn over(
        gpu: &'a Gpu,
        surfaces: &'a Surfaces<'a>,
        bvh: &'a SceneBvh,
        camera: &Camera,
        settings: &'a Settings,
        make: impl FnOnce(&Scene) -> Result<TracedScene, DeviceError>,
    ) -> Result<Self, DeviceError> {
        let wanted = Wanted { streams: true, few_rounds: None };
        Self::made(gpu, surfaces, bvh, (camera, settings), wanted, |scene| Ok(Traced::Own(make(scene)?)))
    }

    /// [`Self::new`] for a frame of a sequence: uploads what changed since the last one, which must be dropped before. Where the device
    /// builds the acceleration structure, it updates that of the last frame.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn in_frame(
        gpu: &'a Gpu,
        surfaces: &'a Surfaces<'a>,
        bvh: &'a SceneBvh,
        camera: &Camera,
        settings: &'a Settings,
        frames: &'a mut DeviceFrames,
    ) -> Result<Self, DeviceError> {
        let pace = frames.pace();
        let n = n_samples(settings);
        let wanted = Wanted { streams: n > SMALL_FRAME, few_rounds: (n <= MEDIUM_FRAME).then_some(ROUNDS_OF_FRAME) };
        let made =
            Self::made(gpu, surfaces, bvh, (camera, settings), wanted, |scene| traced_frame(gpu, scene, bvh, frames))?;
        Ok(Self { pace, ..made })
    }

    fn made(
        gpu: &'a Gpu,
        surfaces: &'a Surfaces<'a>,
        bvh: &'a SceneBvh,
        (camera, settings): (&Camera, &'a Settings),
        wanted: Wanted,
        make: impl FnOnce(&Scene) -> Result<Traced<'a>, DeviceError>,
    ) -> Result<Self, DeviceError> {
        let scene = surfaces.scene();
        let cpu = Rendering::new(scene, bvh, surfaces, camera, settings)?;
        collector::check_size(settings)?;
        picture::check_supported(settings)?;
        // AOVs show the materials of the path integrator.
        let materials = if settings.aovs.is_empty() { settings.integrator } else { Integrator::Path };
        let lacks = |lobes: &Lobes| match settings.integrator {
            Integrator::Path => true,
            Integrator::Hybrid => materials == Integrator::Path && changes_albedo(lobes),
        };
        if scene.materials.iter().filter_map(|material| material.lobes.as_deref()).any(lacks) {
            return Err(DeviceError::Unsupported { what: LOBES });
        }
        let traced = make(scene)?;
        if traced.is_of_driver() {
            return Err(DeviceError::Unsupported { what: "pictures by ray queries of the driver" });
        }
        let is_flat = matches!(bvh.levels(), SceneLevels::One(_));
        let packed = PackedScene::new(gpu, scene, surfaces.textures(), settings, is_flat, materials)?;
        let sky = DeviceSky::new(gpu, scene)?;
        let ambient = bounded(Lights::new(scene).ambient());
        let Rendering { view, filter, ao_radius, .. } = &cpu;
        let facts = picture::picture(view, settings, *ao_radius);
        let background = bounded(scene.background.unwrap_or_default());
        let has_background = u32::from(scene.background.is_some());
        let ground = scene.ground.unwrap_or(u32::MAX);
        let facts = PackedPicture { ambient, slack: packed.slack, background, has_background, ground, ..facts };
        let filter_table = match settings.filter {
            Filter::Box(_) => None,
            _ => Some(gpu.read_only("filter", &filter.table())?),
        };
        let time = if scene.has_motion() { choice::Time::Shutter } else { choice::Time::Still };
        let shared = |count: choice::Count| {
            let chosen = Variant::none().with(count).with(time);
            traced.specialize(picture::specialize(chosen, view, settings))
        };
        let chosen = sky.specialize(shared(choice::Count::None)).with(records::components(settings.aovs));
        let (kernel, chosen, sampled) = match settings.integrator {
            Integrator::Hybrid => {
                let chosen = chosen.with(records::first_light(settings.aovs));
                (wgsl::render::HYBRID, packed.specialize_hybrid(chosen, settings), None)
            }
            Integrator::Path => {
                let sampled = SampledLights::new(gpu, cpu.light_sampler(), |instance| packed.slack_of(instance))?;
                (wgsl::render::PATH, packed.specialize_path(chosen, &sampled, settings), Some(sampled))
            }
        };
        let guide = || {
            let counts = settings.aovs.contains(Aov::Tests);
            let chosen = shared(if counts { choice::Count::Tests } else { choice::Count::None });
            gpu.kernel(wgsl::render::GUIDE, &packed.specialize_guide(chosen))
        };
        let guide = (!settings.aovs.is_empty()).then(guide).transpose()?;
        let light = match settings.integrator {
            Integrator::Hybrid => chosen.clone().with(choice::First::Trace),
            Integrator::Path => chosen.clone(),
        };
        let no_streams = no_streams(gpu, (scene, &traced), settings);
        let made = match no_streams.or((!wanted.streams).then_some("few samples in a frame")) {
            Some(reason) => Err(reason),
            None => match streams(gpu, &chosen, (scene, &packed, &traced), settings, wanted.few_rounds) {
                // The kernel that shades takes more storage buffers, also than the one that ends samples.
                Err(GpuError::Limit { limit, .. }) => Err(limit),
                made => Ok(made?),
            },
        };
        let light = match made {
            Ok(kernels) => kernels,
            Err(reason) => LightKernels::Whole(gpu.kernel(kernel, &light)?, reason),
        };
        let sums = || SumKernels::new(gpu, &chosen, settings.aovs);
        let sums = (settings.sums == SampleSums::Device).then(sums).transpose()?;
        let kernels = RenderKernels { light, guide, sums };
        let picture = gpu.read_only_uniform("picture", &facts)?;
        Ok(Self {
            gpu,
            surfaces,
            settings,
            cpu,
            traced,
            packed,
            sky,
            sampled,
            picture,
            filter_table,
            chosen,
            no_streams,
            n_exact_rays: AtomicU64::new(0),
            pace: Arc::default(),
            kernels,
            first_seen: None,
        })
    }

    /// The same picture by another kernel, and with what that kernel reads.
    pub(super) fn with_kernels(self, light: LightKernels, first_seen: Option<Buffer<[u32; 2]>>) -> Self {
        Self { kernels: RenderKernels { light, ..self.kernels }, first_seen, ..self }
    }

    /// The same picture with its rays traced as streams or within one kernel, to compare both.
    ///
    /// # Errors
    /// Streams of a picture that has none: of scenes with curves or patches, and of many bounces or lights; a limit of the device.
    #[doc(hidden)]
    pub fn with_streams(self, are_wanted: bool) -> Result<Self, DeviceError> {
        if are_wanted && self.no_streams.is_some() {
            return Err(DeviceError::Unsupported { what: "this picture as streams of rays" });
        }
        let light = if are_wanted {
            self.streams(None)?
        } else {
            let chosen = self.chosen.clone();
            let kernel = match self.settings.integrator {
                Integrator::Path => self.gpu.kernel(wgsl::render::PATH, &chosen)?,
                Integrator::Hybrid => self.gpu.kernel(wgsl::render::HYBRID, &chosen.with(choice::First::Trace))?,
            };
            LightKernels::Whole(kernel, "a comparison")
        };
        Ok(self.with_kernels(light, None))
    }

    fn streams(&self, few: Option<u32>) -> Result<LightKernels, GpuError> {
        let scene = (self.surfaces.scene(), &self.packed, &*self.traced);
        streams(self.gpu, &self.chosen, scene, self.settings, few)
    }

    /// The same picture as streams of rays of so many rounds, after which one kernel ends all samples, as in a frame.
    ///
    /// # Errors
    /// A limit of the device.
    #[doc(hidden)]
    pub fn with_few_rounds(self, n: u32) -> Result<Self, DeviceError> {
        let light = self.streams(Some(n))?;
        Ok(self.with_kernels(light, None))
    }

    /// The same picture as if its samples had needed so many rounds of rays so far, to test those that need more.
    #[doc(hidden)]
    #[must_use]
    pub fn expecting_rounds(self, n: u32) -> Self {
        let pace = Pace::default();
        pace.took_rounds(n);
        Self { pace: Arc::new(pace), ..self }
    }

    /// Why one kernel takes each sample with all its rays: what prevents streams of rays, or takes longer with them; `None` where rays are traced as
    /// streams.
    #[must_use]
    pub fn without_streams(&self) -> Option<&'static str> {
        match &self.kernels.light {
            LightKernels::Whole(_, reason) => Some(reason),
            LightKernels::Streams(_) => None,
        }
    }

    /// How many rays exact arithmetic decided in pictures so far; `None` where it traces all, as where an invocation traces the rays of a whole sample or the
    /// rest of one.
    #[must_use]
    pub fn n_exact_rays(&self) -> Option<u64> {
        match &self.kernels.light {
            LightKernels::Streams(kernels) if kernels.are_queries() && self.traced.decides_by_f32(self.gpu) => {
                Some(self.n_exact_rays.load(Ordering::Relaxed))
            }
            _ => None,
        }
    }

    /// The buffers that the kernels bind, and their sizes in bytes.
    #[must_use]
    pub fn buffers(&self) -> Vec<(&str, u64)> {
        let by_queries = match &self.kernels.light {
            LightKernels::Whole(..) => vec![],
            LightKernels::Streams(kernels) if kernels.has_queries() => self.traced.bindings(),
            LightKernels::Streams(_) => vec![],
        };
        let is_bound = |name: &str| self.kernels.binds(name) || by_queries.iter().any(|(known, _)| *known == name);
        let bound = self.bindings().into_iter().filter(|(name, _)| is_bound(name));
        bound.map(|(name, buffer)| (name, buffer.n_bytes())).collect()
    }

    /// Renders the tiles that are not in `done`, which an earlier call on any machine finished.
    ///
    /// Samples differ from the CPU's by rounding, and where rounding sends a path elsewhere; their sums have the bits of the CPU's sums of
    /// the same samples, wherever they are made ([`SampleSums`]).
    ///
    /// # Errors
    /// A tile of another picture, [`crate::RenderError::Cancelled`], or the loss of the device.
    pub fn render(&self, done: Vec<Tile>, monitor: &Monitor) -> Result<Film, DeviceError> {
        self.render_with(self.settings, done, monitor)
    }

    /// Renders a part of the samples: the first one and one past the last, or all for `None`, whatever the settings say. Joined parts have
    /// the bits of an undivided render.
    ///
    /// # Errors
    /// As [`DevicePicture::render`]; a range that is empty, or exceeds the samples.
    pub fn render_part(&self, part: Option<[u32; 2]>, monitor: &Monitor) -> Result<Film, DeviceError> {
        let settings = Settings { part, ..*self.settings };
        crate::render::check(&settings)?;
        self.render_with(&settings, Vec::new(), monitor)
    }

    fn render_with(&self, settings: &Settings, done: Vec<Tile>, monitor: &Monitor) -> Result<Film, DeviceError> {
        let schedule = Schedule::new(settings.tiling(), done, monitor)?;
        self.cpu.with_tiles(|tiles| self.run(&schedule, tiles, settings))?;
        Ok(schedule.into_film()?.0)
    }

    /// Renders like [`Self::render`], together with the caller's thread pool.
    ///
    /// Each tile has the bits of the machine that rendered it, so the picture depends on how the tiles were distributed.
    ///
    /// # Errors
    /// A tile of another picture, or [`crate::RenderError::Cancelled`]. After the loss of the device the CPU renders the rest.
    pub fn render_with_cpu(&self, done: Vec<Tile>, monitor: &Monitor) -> Result<SharedFilm, DeviceError> {
        let schedule = Schedule::new(self.settings.tiling(), done, monitor)?;
        let by_device = self.cpu.with_tiles(|tiles| {
            rayon::in_place_scope(|scope| {
                schedule.spawn_cpu_workers(scope, tiles);
                self.run(&schedule, tiles, self.settings)
            })
        });
        let (film, n_tiles_of_device) = schedule.into_film()?;
        Ok(SharedFilm { film, n_tiles_of_device, stopped: by_device.err() })
    }

    /// Renders tiles until none is left; the CPU takes the samples that the device cannot finish.
    fn run(&self, schedule: &Schedule, tiles: &dyn RenderTiles, settings: &Settings) -> Result<(), GpuError> {
        let weight = self.cpu.weights();
        let mut collector = SampleCollector {
            dispatcher: SampleDispatcher::new(
                self.gpu,
                &self.traced,
                (&self.kernels, &self.pace),
                settings.aovs,
                (n_groups(settings), settings.range().len() as u32),
            )?,
            bindings: self.bindings(),
            settings,
            weight: &weight,
            tiles,
        };
        loop {
            let numbers = schedule.next_for_device(|offered| collector.n_tiles_per_dispatch(&schedule.tiling, offered));
            if numbers.is_empty() || schedule.is_over(&numbers) {
                self.n_exact_rays.fetch_add(collector.dispatcher.n_exact_rays, Ordering::Relaxed);
                return Ok(());
            }
            let made = collector.tiles(&schedule.tiling, &numbers, &|| schedule.is_over(&numbers))?;
            for tile in made.into_iter().flatten() {
                schedule.finish(tile, Worker::Device);
            }
        }
    }

    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound = self.packed.bindings();
        bound.extend(self.sky.bindings());
        bound.extend(self.sampled.iter().flat_map(SampledLights::bindings));
        bound.push(("picture", &self.picture));
        bound.extend(self.filter_table.as_ref().map(|table| -> NamedBinding<'_> { ("filter_table", table) }));
        bound.extend(self.first_seen.as_ref().map(|seen| -> NamedBinding<'_> { ("first_seen", seen) }));
        bound.extend(self.traced.bindings());
        bound
    }
}
