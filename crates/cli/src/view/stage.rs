//! What a session renders from: the scene at a time, its structure, its light.

use std::{cell::RefCell, sync::Arc, time::Instant};

use anyhow::Result;
use canted_obb::Obb;
use canted_renderer::{BoxLevel, Lod, MipMaps, Surfaces, View};
use canted_scene::{AnimatedScene, Camera, Environment, Scene};

use super::{
    frame::Seen,
    options::Options,
    traced::{Traced, traced},
};
use crate::{
    light::LightSource,
    load,
    render::{self, Args},
};

/// A scene that is ready to render, and what it was made from.
pub(super) struct Stage {
    pub(super) scene: Scene,
    pub(super) traced: Box<dyn Traced>,
    /// First and last time of the animation in seconds, if the file has one.
    pub(super) time_range: Option<[f32; 2]>,
    /// When scene and structure were ready.
    pub(super) ready: Instant,
    animated: Option<AnimatedScene>,
    /// The environment that the options or the file set.
    environment: Option<Environment>,
    source: LightSource,
    scene_key: String,
    structure_key: String,
    time: Option<f32>,
    mip_maps: RefCell<Option<(Lod, MipMaps)>>,
    boxes: Option<(BoxLevel, Arc<Vec<Obb>>)>,
    /// Counted once for each structure: that visits all nodes.
    n_levels: Option<u32>,
    /// Whether the light was decided for some camera.
    is_chosen: bool,
}

impl Stage {
    /// Reads the scene and builds the structure.
    pub(super) fn open(options: &Options, args: &Args) -> Result<Self> {
        let (mut scene, animated) = read(options, args)?;
        let source = args.light.apply(&mut scene)?;
        let environment = scene.environment.clone().filter(|_| source == LightSource::Given);
        let traced = traced(&scene, args)?;
        Ok(Self {
            scene,
            traced,
            time_range: animated.as_ref().and_then(AnimatedScene::time_range),
            ready: Instant::now(),
            animated,
            environment,
            source,
            scene_key: options.scene_key(),
            structure_key: options.structure_key(),
            time: args.time,
            mip_maps: RefCell::default(),
            boxes: None,
            n_levels: None,
            is_chosen: false,
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
        let has_other_structure = next.structure_key != options.structure_key();
        if has_other_structure {
            next.traced = traced(&next.scene, args)?;
        } else if next.time != args.time {
            next.traced.update(&next.scene)?;
        }
        if has_other_structure || next.time != args.time {
            next.boxes = None;
            next.n_levels = None;
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

    /// Whether the light is one that was decided for some camera.
    pub(super) fn is_chosen(&self) -> bool {
        self.is_chosen
    }

    /// Decides light and integrator for a camera.
    pub(super) fn choose(&mut self, camera: &Camera, args: &mut Args) -> Result<()> {
        self.is_chosen = true;
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
    pub(super) fn with_surfaces<R>(&self, lod: Lod, then: impl FnOnce(&Surfaces, &dyn Traced) -> R) -> R {
        let known = self.mip_maps.take().filter(|(of, _)| *of == lod);
        let surfaces = match &known {
            Some((_, known)) => Surfaces::with_mip_maps(&self.scene, lod, known),
            None => Surfaces::with_lod(&self.scene, lod),
        };
        self.mip_maps.replace(Some((lod, surfaces.mip_maps())));
        then(&surfaces, &*self.traced)
    }

    /// The boxes of a level. Warns where there are none.
    pub(super) fn boxes(&mut self, level: BoxLevel) -> Arc<Vec<Obb>> {
        if let Some((_, boxes)) = self.boxes.as_ref().filter(|(of, _)| *of == level) {
            return Arc::clone(boxes);
        }
        let boxes = Arc::new(self.traced.boxes(level));
        if boxes.is_empty() {
            crate::output::warn(&render::no_boxes(level, self.n_levels()));
        }
        self.boxes = Some((level, Arc::clone(&boxes)));
        boxes
    }

    /// Levels of the structure that have boxes.
    pub(super) fn n_levels(&mut self) -> u32 {
        *self.n_levels.get_or_insert_with(|| self.traced.n_levels())
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
    let of_file = args.read_options(args.time);
    if let Some(path) = path {
        let (animated, mut scene) = AnimatedScene::open(path, &of_file)?;
        if animated.is_animated() {
            load::warn(&std::mem::take(&mut scene.warnings));
            return Ok((scene, Some(animated)));
        }
        if args.time.is_none() && args.animation.is_none() {
            load::warn(&std::mem::take(&mut scene.warnings));
            return Ok((scene, None));
        }
    }
    // Reports options that do not apply to the file.
    Ok((load::scene_with(options.scene(), &of_file)?, None))
}
