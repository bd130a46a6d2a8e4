//! Pictures by a device.

use std::sync::atomic::Ordering;

use canted_film::Sums;
use canted_film::{Aov, Film, Filter, Tile};
use canted_gpu::{Buffer, Gpu, NamedBinding, Specialisation, TracedScene};
use canted_scene::{Camera, Scene};
use canted_wide::{LaneKernel, TriangleBvh};

use super::DeviceError;
use super::environment::DeviceSky;
use super::film::{self, Taker};
use super::lights::{SampledLights, bounded};
use super::picture::{self, PackedPicture};
use super::scene::PackedScene;
use super::slices::Slicer;
use super::stages::{Light, Stages};
use crate::render::{Rendering, in_place};
use crate::structure::instances;
use crate::{Integrator, Level, Lights, Monitor, Pattern, RenderError, Settings, Structure, Surfaces};

/// Most samples of a pixel whose strata kernels count in 32 bits.
const MOST_STRATIFIED: u32 = 1 << 20;

/// A picture's scene and settings on a device, ready to be rendered.
pub struct DevicePicture<'a, K: LaneKernel> {
    pub(super) gpu: &'a Gpu,
    pub(super) surfaces: &'a Surfaces<'a>,
    pub(super) settings: &'a Settings,
    /// Takes the samples that the device could not finish.
    pub(super) on_cpu: Rendering<'a, Structure<K>>,
    traced: TracedScene,
    pub(super) packed: PackedScene,
    sky: DeviceSky,
    /// What the path integrator samples.
    sampled: Option<SampledLights>,
    picture: Buffer<PackedPicture>,
    filter_table: Option<Buffer<f32>>,
    /// What is chosen of its kernel.
    chosen: Specialisation,
    pub(super) stages: Stages,
}

impl<'a, K: LaneKernel> DevicePicture<'a, K> {
    /// Takes to the device what the picture needs of a scene, and of the structure that answers its rays.
    ///
    /// # Errors
    /// Scenes and settings that make no picture, that kernels do not know, or that the device has no room for.
    pub fn new(
        gpu: &'a Gpu,
        surfaces: &'a Surfaces<'a>,
        structure: &'a Structure<K>,
        camera: &Camera,
        settings: &'a Settings,
    ) -> Result<Self, DeviceError> {
        let scene = surfaces.scene();
        let on_cpu = Rendering::new(scene, structure, surfaces, camera, settings)?;
        film::check(settings)?;
        check_known(settings)?;
        let traced = traced_scene(gpu, scene, structure)?;
        // Channels beside light tell of materials what the path integrator knows of them.
        let looks = if settings.aovs.is_empty() { settings.integrator } else { Integrator::Path };
        let is_flat = matches!(structure, Structure::One(_));
        let packed = PackedScene::new(gpu, scene, surfaces.textures(), settings.lod, is_flat, looks)?;
        let sky = DeviceSky::new(gpu, scene)?;
        let ambient = bounded(Lights::new(scene).ambient());
        let Rendering { view, filter, ao_radius, .. } = &on_cpu;
        let facts = picture::picture(view, settings, *ao_radius);
        let facts = PackedPicture { ambient, slack: packed.slack, ..facts };
        let filter_table = match settings.filter {
            Filter::Box(_) => None,
            _ => Some(gpu.buffer("filter", &filter.table())?),
        };
        let time = if scene.has_motion() { "shared/time/shutter" } else { "shared/time/still" };
        let shared = |count: &str| {
            let chosen = Specialisation::none().part("count", count).part("time", time);
            traced.specialise(picture::specialise(chosen, view, settings))
        };
        let chosen = sky.specialise(shared("shared/count/none").part("film", "shared/film/samples"));
        let (kernel, chosen, sampled) = match settings.integrator {
            Integrator::Hybrid => ("render/hybrid", packed.specialise_hybrid(chosen), None),
            Integrator::Path => {
                let sampled = SampledLights::new(gpu, on_cpu.light_sampler(), |instance| packed.slack_of(instance))?;
                ("render/path", packed.specialise_path(chosen, &sampled), Some(sampled))
            }
        };
        let guide = || {
            let counts = settings.aovs.contains(Aov::Tests);
            let chosen = shared(if counts { "shared/count/tests" } else { "shared/count/none" });
            gpu.kernel("render/guide", &packed.specialise_guide(chosen))
        };
        let guide = (!settings.aovs.is_empty()).then(guide).transpose()?;
        let stages = Stages { light: Light::One(gpu.kernel(kernel, &chosen)?), guide };
        let picture = gpu.uniform("picture", &facts)?;
        Ok(Self {
            gpu,
            surfaces,
            settings,
            on_cpu,
            traced,
            packed,
            sky,
            sampled,
            picture,
            filter_table,
            chosen,
            stages,
        })
    }

    /// The same picture by a wavefront: kernels that generate, trace and shade hand paths to each other, and those that go on are
    /// closed up between (Laine, Karras, Aila 2013). Samples are the same but for how a compiler contracts sums and products.
    ///
    /// # Errors
    /// The hybrid integrator, which has no such kernels; what the device refuses.
    pub fn in_waves(self) -> Result<Self, DeviceError> {
        if self.settings.integrator != Integrator::Path {
            return Err(DeviceError::Unknown { what: "a wavefront of the hybrid integrator" });
        }
        let light = Light::waves(self.gpu, &self.chosen)?;
        Ok(Self { stages: Stages { light, ..self.stages }, ..self })
    }

    /// What the kernel binds of scene and picture, and the bytes of each in the device's memory.
    #[must_use]
    pub fn buffers(&self) -> Vec<(&str, u64)> {
        let bound = self.bound().into_iter().filter(|(name, _)| self.stages.binds(name));
        bound.map(|(name, buffer)| (name, buffer.n_bytes())).collect()
    }

    /// Renders what is not in `done`: tiles that an earlier call, here or on the CPU, finished.
    ///
    /// Samples are those of the CPU but for roundings, and for paths that these send elsewhere; sums are made as there, in
    /// the same order.
    ///
    /// # Errors
    /// A tile that cannot be of this picture, [`RenderError::Cancelled`], or the loss of the device.
    pub fn render(&self, done: Vec<Tile>, monitor: &Monitor) -> Result<Film, DeviceError> {
        let tiling = self.settings.tiling();
        let mut slots = in_place(&tiling, done)?;
        let left: Vec<usize> = (0..slots.len()).filter(|&number| slots[number].is_none()).collect();
        let mut n_done = slots.len() - left.len();
        let slicer = Slicer::new(self.gpu, self.stages.clone())?;
        let weight = self.on_cpu.weights();
        let on_cpu = |at, sample, sums: &mut Sums| self.on_cpu.take(at, sample, sums);
        let mut taker =
            Taker { slicer, bound: self.bound(), settings: self.settings, weight: &weight, on_cpu: &on_cpu };
        let mut left = &left[..];
        while !left.is_empty() {
            let (now, later) = left.split_at(film::next_run(&taker.slicer, &tiling, self.settings, left));
            left = later;
            let made = film::tiles(&mut taker, &tiling, now, &|| monitor.cancel.load(Ordering::Relaxed))?;
            for tile in made.ok_or(RenderError::Cancelled)? {
                (monitor.finished)(&tile);
                n_done += 1;
                (monitor.progress)(n_done, tiling.n_tiles());
                let number = tile.number;
                slots[number] = Some(tile);
            }
        }
        let tiles: Vec<Tile> = slots.into_iter().flatten().collect();
        Ok(tiling.film(&tiles))
    }

    pub(super) fn bound(&self) -> Vec<NamedBinding<'_>> {
        let mut bound = self.packed.bindings();
        bound.extend(self.sky.bindings());
        bound.extend(self.sampled.iter().flat_map(SampledLights::bindings));
        bound.push(("picture", &self.picture));
        bound.extend(self.filter_table.as_ref().map(|table| -> NamedBinding<'_> { ("filter_table", table) }));
        bound.extend(self.traced.bindings());
        bound
    }
}

/// The structure of a scene in a device's memory, ready for rays.
///
/// # Errors
/// Binary trees, which kernels do not know; more than the device has room for; instances that it does not trace.
pub fn traced_scene<K: LaneKernel>(
    gpu: &Gpu,
    scene: &Scene,
    structure: &Structure<K>,
) -> Result<TracedScene, DeviceError> {
    fn wide<K: LaneKernel>(level: &Level<K>) -> Result<&TriangleBvh<K>, DeviceError> {
        match level {
            Level::Wide(wide) => Ok(wide),
            Level::Binary(..) => Err(DeviceError::Unknown { what: "binary trees, which --volumes by name makes" }),
        }
    }
    Ok(match structure {
        Structure::One(flat) => TracedScene::single_level(gpu, wide(flat.blas())?, flat.first())?,
        Structure::Two(tlas) => {
            let meshes = tlas.blas().iter().map(wide).collect::<Result<Vec<_>, _>>()?;
            TracedScene::two_level(gpu, &meshes, &instances(scene))?
        }
    })
}

/// Refuses what there are no kernels for.
fn check_known(settings: &Settings) -> Result<(), DeviceError> {
    let unknown = [(
        settings.pattern == Pattern::Stratified && settings.samples > MOST_STRATIFIED,
        "more than 1048576 stratified samples of a pixel",
    )];
    match unknown.into_iter().find(|(is_asked, _)| *is_asked) {
        Some((_, what)) => Err(DeviceError::Unknown { what }),
        None => Ok(()),
    }
}
