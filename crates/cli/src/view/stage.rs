//! What a session renders from: the scene at a time, its structure, its light.

use std::sync::atomic::AtomicBool;

use anyhow::{Result, anyhow};
use canted_film::Film;
use canted_renderer::{
    Lod, Masked, MipMaps, Monitor, Prepared, Settings, Surfaces, Tracer, View, heatmap, prepare, resume_with,
};
use canted_scene::{AnimatedScene, Camera, Environment, Scene};
use canted_trace::{Hit, Ray};
use canted_wide::LaneKernel;

use super::options::Options;
use crate::{
    light::LightSource,
    load,
    options::with_kernel,
    render::{self, Args},
};

/// A structure of any kernel.
pub(super) trait Traced {
    fn camera(&self, scene: &Scene, args: &Args) -> Result<Camera>;
    /// Decides light and integrator as `canted render` does.
    fn choose(&mut self, scene: &mut Scene, camera: &Camera, args: &mut Args, source: LightSource) -> Result<()>;
    fn film(&self, surfaces: &Surfaces, camera: &Camera, settings: &Settings, cancel: &AtomicBool) -> Result<Film>;
    fn heatmap(&self, surfaces: &Surfaces, camera: &Camera, args: &Args) -> Result<canted_film::Picture>;
    fn hit(&self, surfaces: &Surfaces, ray: &Ray) -> Option<Hit>;
}

impl<K: LaneKernel> Traced for Prepared<K> {
    fn camera(&self, scene: &Scene, args: &Args) -> Result<Camera> {
        args.camera.camera(scene, self, args.size)
    }

    fn choose(&mut self, scene: &mut Scene, camera: &Camera, args: &mut Args, source: LightSource) -> Result<()> {
        let source = render::decided(scene, self, camera, args, source)?;
        render::choose(scene, self, camera, args, source).map(drop)
    }

    fn film(&self, surfaces: &Surfaces, camera: &Camera, settings: &Settings, cancel: &AtomicBool) -> Result<Film> {
        let monitor = Monitor { progress: &|_, _| {}, finished: &|_| {}, cancel };
        Ok(resume_with(surfaces, &self.structure, camera, settings, Vec::new(), &monitor)?)
    }

    fn heatmap(&self, surfaces: &Surfaces, camera: &Camera, args: &Args) -> Result<canted_film::Picture> {
        let measure = args.heatmap.ok_or_else(|| anyhow!("no heat map is shown"))?;
        Ok(heatmap(surfaces, &self.structure, camera, args.size, measure, args.heatmap_scale)?.picture)
    }

    fn hit(&self, surfaces: &Surfaces, ray: &Ray) -> Option<Hit> {
        self.structure.closest_hit(ray, &mut Masked::new(surfaces, ()))
    }
}

fn build<K: LaneKernel + 'static>(scene: &Scene, args: &Args) -> Result<Box<dyn Traced>> {
    let name = load::name(args.scene.as_deref());
    let prepared: Prepared<K> =
        prepare(scene, &args.structure.config(scene)?).map_err(|error| anyhow!("{name}: {error}"))?;
    Ok(Box::new(prepared))
}

/// A scene that is ready to render, and what it was made from.
pub(super) struct Stage {
    pub(super) scene: Scene,
    pub(super) traced: Box<dyn Traced>,
    /// Whether the file has an animation.
    pub(super) is_animated: bool,
    animated: Option<AnimatedScene>,
    /// The environment that the options or the file set.
    environment: Option<Environment>,
    source: LightSource,
    scene_key: String,
    structure_key: String,
    time: Option<f32>,
    mip_maps: Option<(Lod, MipMaps)>,
}

impl Stage {
    /// Reads the scene and builds the structure.
    pub(super) fn open(options: &Options, args: &Args) -> Result<Self> {
        let (mut scene, animated) = read(options, args)?;
        let source = args.light.apply(&mut scene)?;
        let environment = scene.environment.clone().filter(|_| source == LightSource::Given);
        let traced = with_kernel!(args.structure.triangles, build(&scene, args))?;
        Ok(Self {
            is_animated: animated.is_some(),
            scene,
            traced,
            animated,
            environment,
            source,
            scene_key: options.scene_key(),
            structure_key: options.structure_key(),
            time: args.time,
            mip_maps: None,
        })
    }

    /// The stage for other options, with everything that they do not change.
    pub(super) fn followed(self, options: &Options, args: &Args) -> Result<Self> {
        let is_same_scene = self.scene_key == options.scene_key();
        let mut next = match (is_same_scene, args.time == self.time, args.time) {
            (true, true, _) => self,
            (true, false, Some(time)) if self.animated.is_some() => self.posed(args, time)?,
            _ => return Self::open(options, args),
        };
        if next.structure_key != options.structure_key() || next.time != args.time {
            next.traced = with_kernel!(args.structure.triangles, build(&next.scene, args))?;
        }
        next.structure_key = options.structure_key();
        next.time = args.time;
        Ok(next)
    }

    /// The scene at another time.
    fn posed(mut self, args: &Args, time: f32) -> Result<Self> {
        if let Some(animated) = &mut self.animated {
            animated.pose(time, &mut self.scene)?;
            self.scene.environment.clone_from(&self.environment);
            // Reading an environment map again is not needed.
            self.source = args.light.apply_lights(&mut self.scene)?;
            load::warn(&std::mem::take(&mut self.scene.warnings));
        }
        Ok(self)
    }

    /// Decides light and integrator for a camera.
    pub(super) fn choose(&mut self, camera: &Camera, args: &mut Args) -> Result<()> {
        if self.source != LightSource::Given {
            // What the last camera needed.
            self.scene.lights.clear();
            self.scene.environment = None;
        }
        self.traced.choose(&mut self.scene, camera, args, self.source)
    }

    /// Chooses the integrator for a first, coarse picture, with the light as it is.
    pub(super) fn choose_integrator(&self, args: &mut Args) {
        args.choose_integrator(&self.scene, self.source == LightSource::Emission);
    }

    /// Calls `then` with the surfaces of the scene.
    pub(super) fn with_surfaces<R>(&mut self, lod: Lod, then: impl FnOnce(&Surfaces, &dyn Traced) -> R) -> R {
        let known = self.mip_maps.take().filter(|(of, _)| *of == lod);
        let surfaces = match &known {
            Some((_, known)) => Surfaces::with_mip_maps(&self.scene, lod, known),
            None => Surfaces::with_lod(&self.scene, lod),
        };
        self.mip_maps = Some((lod, surfaces.mip_maps()));
        then(&surfaces, &*self.traced)
    }

    /// What a camera sees at a position in pixels.
    pub(super) fn seen_at(&self, camera: &Camera, [width, height]: [u32; 2], position: [f64; 2]) -> Option<Seen> {
        let ray = View::new(camera, width, height).ok()?.ray(position);
        let surfaces = Surfaces::new(&self.scene);
        let hit = self.traced.hit(&surfaces, &ray)?;
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
fn read(options: &Options, args: &Args) -> Result<(Scene, Option<AnimatedScene>)> {
    let path = options.scene().filter(|path| !load::is_scene_file(path));
    let animation = args.animation.as_deref();
    if let Some(path) = path {
        let of_file = args.read_options(args.time);
        let (animated, mut scene) = AnimatedScene::open(path, &of_file)?;
        if animated.is_animated() {
            load::warn(&std::mem::take(&mut scene.warnings));
            return Ok((scene, Some(animated)));
        }
        if args.time.is_none() && animation.is_none() {
            load::warn(&std::mem::take(&mut scene.warnings));
            return Ok((scene, None));
        }
    }
    // Reports options that do not apply to the file.
    Ok((load::scene(options.scene(), args.time, animation)?, None))
}

/// What is at a position of the picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seen {
    pub(crate) instance: u32,
    /// Triangle of the mesh.
    pub(crate) primitive: u32,
    /// Distance from the camera in world units.
    pub(crate) t: f32,
    /// Weights of the second and third vertex.
    pub(crate) barycentric: [f32; 2],
    /// Texture coordinates, if the mesh has some.
    pub(crate) texture: Option<[f32; 2]>,
    pub(crate) mesh: String,
    pub(crate) material: String,
}
