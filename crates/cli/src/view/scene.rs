//! What a session renders from: the scene at a time, its light, its structure with any triangle test, and the device that renders it.

use std::{
    cell::RefCell,
    sync::{Arc, atomic::AtomicBool},
    time::Instant,
};

use anyhow::{Error, Result, anyhow};
use canted_film::Film;
use canted_obb::Obb;
use canted_renderer::{
    BoxLevel, HitFilter, Lod, MipMaps, Monitor, SceneBvh, Settings, Surfaces, UpdateOptions, View, resume_with,
};
use canted_scene::{AnimatedScene, Camera, Environment, Scene};
use canted_trace::Intersect as _;

use super::{
    frame::Seen,
    options::{Options, SceneKey},
};
use crate::{
    camera::{CameraSource, Staged},
    device::{DeviceArg, Machine},
    light::{LightSource, ground},
    load,
    options::{Structure, StructureOptions},
    output, render,
    settings::Plan,
};

/// A scene that is ready to render, and what it was made from.
pub(super) struct SessionScene {
    pub(super) scene: Scene,
    pub(super) bvh: SceneBvh,
    /// First and last time of the animation in seconds, if the file has one.
    pub(super) time_range: Option<[f32; 2]>,
    /// When scene and structure were ready.
    pub(super) ready: Instant,
    animated: Option<AnimatedScene>,
    /// The environment that the options or the file set.
    environment: Option<Environment>,
    source: LightSource,
    scene_key: SceneKey,
    structure_key: StructureOptions,
    time: Option<f32>,
    mip_maps: RefCell<Option<(Lod, MipMaps)>>,
    boxes: Option<(BoxLevel, Arc<Vec<Obb>>)>,
    /// Counted once for each structure: that visits all nodes.
    n_levels: Option<u32>,
    /// Whether the light was decided for some camera.
    is_chosen: bool,
    /// What the scene is about, if that was needed, and for which up direction.
    staged: Option<([f32; 3], Staged)>,
    /// Whether the scene shows that z is up.
    is_z_up: bool,
}

impl SessionScene {
    /// Reads the scene and builds the structure.
    pub(super) fn open(options: &Options, plan: &Plan) -> Result<Self> {
        let (mut scene, animated) = read(options, plan)?;
        let source = plan.apply_light(&mut scene)?;
        let environment = scene.environment.clone().filter(|_| source == LightSource::Given);
        let is_z_up = plan.shows_z_up(&scene);
        let mut plan = plan.clone();
        if is_z_up {
            plan.set_z_up();
        }
        let (bvh, staged) = render::stage(&mut scene, &plan, source, &mut |scene| built(scene, &plan))?;
        Ok(Self {
            scene,
            bvh,
            time_range: animated.as_ref().and_then(AnimatedScene::time_range),
            ready: Instant::now(),
            animated,
            environment,
            source,
            scene_key: options.scene_key(),
            structure_key: options.structure_key().clone(),
            time: plan.source.time(),
            mip_maps: RefCell::default(),
            boxes: None,
            n_levels: None,
            is_chosen: false,
            staged: staged.map(|staged| (plan.up(), staged)),
            is_z_up,
        })
    }

    /// The scene for other options, with everything that they do not change.
    pub(super) fn followed(self, options: &Options, plan: &Plan) -> Result<Self> {
        let is_same_scene = self.scene_key == options.scene_key();
        let mut next = match (is_same_scene, plan.source.time() == self.time, plan.source.time()) {
            (true, true, _) => self,
            (true, false, Some(time)) if self.animated.is_some() => self.posed(plan, time)?,
            _ => return Self::open(options, plan),
        };
        let has_other_structure = next.structure_key != *options.structure_key();
        if has_other_structure {
            next.bvh = built(&next.scene, plan)?;
        } else if next.time != plan.source.time() {
            next.bvh.update(&next.scene, &UpdateOptions::default())?;
        }
        if has_other_structure || next.time != plan.source.time() {
            next.boxes = None;
            next.n_levels = None;
        }
        next.structure_key = options.structure_key().clone();
        next.time = plan.source.time();
        Ok(next)
    }

    /// The scene at another time.
    fn posed(mut self, plan: &Plan, time: f32) -> Result<Self> {
        if let Some(animated) = &mut self.animated {
            ground::remove(&mut self.scene);
            self.staged = None;
            animated.pose(time, &mut self.scene)?;
            self.is_z_up = plan.shows_z_up(&self.scene);
            self.scene.environment.clone_from(&self.environment);
            // Reading an environment map again is not needed.
            self.source = plan.light.apply_lights(&mut self.scene, plan.stage.light)?;
            load::report(&mut self.scene);
        }
        Ok(self)
    }

    /// Whether the light is one that was decided for some camera.
    pub(super) fn is_chosen(&self) -> bool {
        self.is_chosen
    }

    /// The camera of the options, with the up axis of the scene in `plan`, and the ground that this camera sees.
    pub(super) fn camera(&mut self, plan: &mut Plan) -> Result<Camera> {
        if self.is_z_up {
            plan.set_z_up();
        }
        let up = plan.up();
        if self.staged.is_none_or(|(of, _)| of != up) {
            let staged = render::staged(&self.scene, &self.bvh, plan, self.source);
            self.staged = staged.map(|staged| (up, staged));
        }
        let (camera, _) = plan.camera(&self.scene, &self.bvh, self.staged())?;
        self.settle(&camera, plan, self.source)?;
        Ok(camera)
    }

    fn staged(&self) -> Option<&Staged> {
        self.staged.as_ref().map(|(_, staged)| staged)
    }

    /// Adds or removes the ground.
    fn settle(&mut self, camera: &Camera, plan: &Plan, source: LightSource) -> Result<()> {
        let staged = self.staged.map(|(_, staged)| staged);
        if render::settle(&mut self.scene, &mut self.bvh, camera, plan, source, staged.as_ref())? {
            self.boxes = None;
            self.n_levels = None;
        }
        Ok(())
    }

    /// Decides light and integrator for a camera.
    pub(super) fn choose(&mut self, camera: &Camera, plan: &mut Plan) -> Result<()> {
        self.is_chosen = true;
        if self.source != LightSource::Given {
            // What the last camera needed.
            self.scene.lights.clear();
            self.scene.environment = None;
        }
        let mut staged = self.staged.map(|(_, staged)| Staged { reflects: true, ..staged });
        let source = render::decided(&self.scene, &self.bvh, camera, plan, self.source, &mut staged)?;
        self.staged = self.staged.and_then(|(up, _)| Some((up, staged?)));
        self.settle(camera, plan, source)?;
        // No report says where the camera comes from.
        let camera = (camera, CameraSource::Given);
        let mut mip_maps = self.mip_maps.take().map(|(_, known)| known);
        let chosen =
            render::choose(&mut self.scene, &mut self.bvh, camera, plan, source, staged.as_ref(), &mut mip_maps);
        self.mip_maps.replace(mip_maps.map(|known| (plan.settings.lod, known)));
        chosen.map(drop)
    }

    /// Chooses the integrator for a first, coarse picture, with the light as it is.
    pub(super) fn choose_integrator(&self, plan: &mut Plan) {
        plan.choose_integrator(&self.scene, self.source == LightSource::Emission);
    }

    /// Calls `then` with the surfaces of the scene.
    pub(super) fn with_surfaces<R>(&self, lod: Lod, then: impl FnOnce(&Surfaces) -> R) -> R {
        let known = self.mip_maps.take().filter(|(of, _)| *of == lod);
        let surfaces = match &known {
            Some((_, known)) => Surfaces::with_mip_maps(&self.scene, lod, known),
            None => Surfaces::with_lod(&self.scene, lod),
        };
        self.mip_maps.replace(Some((lod, surfaces.mip_maps())));
        then(&surfaces)
    }

    /// The boxes of a level. Warns where there are none.
    pub(super) fn boxes(&mut self, level: BoxLevel) -> Arc<Vec<Obb>> {
        if let Some((_, boxes)) = self.boxes.as_ref().filter(|(of, _)| *of == level) {
            return Arc::clone(boxes);
        }
        let boxes = Arc::new(self.bvh.boxes(level));
        if boxes.is_empty() {
            output::warn(&render::no_boxes(level, self.n_levels()));
        }
        self.boxes = Some((level, Arc::clone(&boxes)));
        boxes
    }

    /// Levels of the structure that have boxes.
    pub(super) fn n_levels(&mut self) -> u32 {
        *self.n_levels.get_or_insert_with(|| self.bvh.n_levels())
    }

    /// What a camera sees at a position in pixels.
    pub(super) fn seen_at(&self, camera: &Camera, settings: &Settings, position: [f64; 2]) -> Option<Seen> {
        let view = View::new(camera, settings.width, settings.height).ok()?;
        let surfaces = Surfaces::new(&self.scene);
        let mut filter = HitFilter::new(&surfaces).culling(settings.cull, &view);
        let hit = self.bvh.closest_hit_with(&view.ray(position), &mut filter)?;
        let instance = self.scene.instances.get(hit.instance.0 as usize)?;
        let mesh = self.scene.meshes.get(instance.mesh.0 as usize)?;
        let material = self.scene.materials.get(mesh.material_of(hit.primitive.0).0 as usize)?;
        let texture = mesh.uvs.as_ref().and_then(|uvs| {
            let corners = mesh.triangles.get(hit.primitive.0 as usize)?.map(|i| uvs[i as usize]);
            let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
            Some(std::array::from_fn(|k| corners.iter().zip(weights).map(|(uv, w)| uv[k] * w).sum()))
        });
        Some(Seen {
            instance: hit.instance.0,
            primitive: hit.primitive.0,
            t: hit.t,
            barycentric: [hit.u, hit.v],
            texture,
            mesh: mesh.name.clone(),
            material: material.name.clone(),
        })
    }
}

/// Reads the scene at the time of the options.
fn read(options: &Options, plan: &Plan) -> Result<(Scene, Option<AnimatedScene>)> {
    let path = options.scene().filter(|path| !load::is_scene_file(path));
    let of_file = plan.source.read_options(plan.source.time());
    if let Some(path) = path {
        let (animated, mut scene) = AnimatedScene::open(path, &of_file)?;
        if animated.is_animated() {
            load::report(&mut scene);
            return Ok((scene, Some(animated)));
        }
        if plan.source.time().is_none() && plan.source.animation.is_none() {
            load::report(&mut scene);
            return Ok((scene, None));
        }
    }
    // Reports options that do not apply to the file.
    Ok((load::scene(options.scene(), &of_file)?, None))
}

/// A device that renders the samples of one picture.
pub(super) trait Passes {
    /// `cpu`, or the value of `--device` where a GPU renders.
    fn device(&self) -> &str;

    /// The film of a part of the samples; `settings` differ from those of the picture in nothing else.
    fn film(&self, settings: &Settings, cancel: &AtomicBool) -> Result<Film>;
}

/// What determines the samples of a picture.
pub(super) struct FrameInput<'a> {
    pub(super) surfaces: &'a Surfaces<'a>,
    pub(super) bvh: &'a SceneBvh,
    pub(super) camera: &'a Camera,
    #[cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "only GPUs read it"))]
    pub(super) plan: &'a Plan,
    pub(super) settings: &'a Settings,
}

impl FrameInput<'_> {
    /// Calls `run` with the device that renders the picture: the CPU where `device` cannot.
    pub(super) fn with_passes(&self, device: &Device, run: impl FnOnce(&dyn Passes) -> Result<()>) -> Result<()> {
        #[cfg(feature = "gpu")]
        if let Some(on_gpu) = device.picture(self)? {
            return run(&on_gpu);
        }
        let _ = device;
        run(&OnCpu(self))
    }
}

/// Renders on the threads of the CPU.
struct OnCpu<'a>(&'a FrameInput<'a>);

impl Passes for OnCpu<'_> {
    fn device(&self) -> &str {
        "cpu"
    }

    fn film(&self, settings: &Settings, cancel: &AtomicBool) -> Result<Film> {
        let monitor = Monitor::quiet(cancel);
        let FrameInput { surfaces, bvh, camera, .. } = *self.0;
        Ok(resume_with(surfaces, bvh, camera, settings, Vec::new(), &monitor)?)
    }
}

/// Builds the structure of the options.
fn built(scene: &Scene, plan: &Plan) -> Result<SceneBvh> {
    let name = load::name(plan.source.scene.as_deref());
    SceneBvh::build(scene, &plan.structure.config_for(scene)).map_err(|error| anyhow!("{name}: {error}"))
}

/// The device of the options, open while they name it.
#[derive(Default)]
pub(super) struct Device(Option<(DeviceArg, Machine)>);

impl Device {
    /// Opens the device of the options, if it is not open. Warns where the CPU is used in its place.
    pub(super) fn choose(&mut self, wanted: &DeviceArg, structure: &Structure) {
        if self.0.as_ref().is_some_and(|(open, _)| open == wanted) {
            return;
        }
        let machine = Machine::open(wanted, structure).unwrap_or_else(|error| {
            warn_fallback(&error);
            Machine::Cpu
        });
        self.0 = Some((wanted.clone(), machine));
    }

    /// Opens the device again with the next job: it may have been lost.
    pub(super) fn reset(&mut self) {
        self.0 = None;
    }
}

fn warn_fallback(error: &Error) {
    output::warn(&format!("the CPU renders: {error}"));
}

#[cfg(feature = "gpu")]
mod on_gpu {
    use std::sync::atomic::AtomicBool;

    use anyhow::{Result, anyhow};
    use canted_film::Film;
    use canted_gpu::Gpu;
    use canted_renderer::{DeviceError, DevicePicture, FirstHit, Monitor, Settings, traced_scene};
    use canted_scene::Scene;

    use super::{Device, FrameInput, Passes, warn_fallback};
    use crate::device::{DeviceArg, built_or, named};

    impl Device {
        /// The picture on the GPU; `None` where the CPU renders, with a warning if the GPU does not support the picture.
        pub(in crate::view) fn picture<'a>(&'a self, input: &'a FrameInput<'a>) -> Result<Option<OnGpu<'a>>> {
            let Some((wanted, machine)) = &self.0 else { return Ok(None) };
            let Some(gpu) = machine.gpu() else { return Ok(None) };
            let FrameInput { surfaces, bvh, camera, plan, settings } = *input;
            if let Some(option) = &plan.structure.unsupported_on_gpu {
                warn_fallback(&anyhow!("{option} is not supported on the GPU"));
                return Ok(None);
            }
            let first_hit = if plan.first_hit == FirstHit::Raster { FirstHit::Raster } else { FirstHit::Trace };
            let picture = match plan.structure.built_on_gpu {
                Some(own) => {
                    let config = plan.structure.config;
                    let make = |scene: &Scene| built_or(gpu, scene, &config, own, || traced_scene(gpu, scene, bvh));
                    DevicePicture::over(gpu, surfaces, bvh, camera, settings, make)
                }
                None => DevicePicture::new(gpu, surfaces, bvh, camera, settings),
            };
            match picture.and_then(|picture| picture.with_first_hit(first_hit)) {
                Ok((picture, _)) => Ok(Some(OnGpu { gpu, name: name_of(wanted), picture })),
                Err(DeviceError::Render(error)) => Err(error.into()),
                Err(error) => {
                    warn_fallback(&named(gpu, error));
                    Ok(None)
                }
            }
        }
    }

    /// The value of `--device`.
    fn name_of(device: &DeviceArg) -> String {
        match device {
            DeviceArg::Named(name) => name.clone(),
            _ => "gpu".to_owned(),
        }
    }

    /// Renders on a GPU.
    pub(in crate::view) struct OnGpu<'a> {
        gpu: &'a Gpu,
        name: String,
        picture: DevicePicture<'a>,
    }

    impl Passes for OnGpu<'_> {
        fn device(&self) -> &str {
            &self.name
        }

        fn film(&self, settings: &Settings, cancel: &AtomicBool) -> Result<Film> {
            let monitor = Monitor::quiet(cancel);
            self.picture.render_part(settings.part, &monitor).map_err(|error| named(self.gpu, error))
        }
    }
}
