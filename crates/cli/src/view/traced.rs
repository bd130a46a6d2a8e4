//! A structure with any triangle test, and the devices that render it.

use std::sync::atomic::AtomicBool;

use anyhow::{Result, anyhow};
use canted_film::{Film, Picture};
use canted_obb::Obb;
use canted_renderer::{
    BoxLevel, Masked, Monitor, Prepared, Settings, Structure, Surfaces, Tracer, UpdateOptions, heatmap, prepare,
    resume_with,
};
use canted_scene::{Camera, Scene};
use canted_trace::{Hit, Ray};
use canted_wide::LaneKernel;

use super::device::Device;
use crate::{
    light::LightSource,
    load,
    options::with_kernel,
    render::{self, Args},
};

/// A device that renders the samples of one picture.
pub(super) trait Passes {
    /// `cpu`, or the value of `--device` where a GPU renders.
    fn device(&self) -> &str;

    /// The film of a part of the samples; `settings` differ from those of the picture in nothing else.
    fn film(&self, settings: &Settings, cancel: &AtomicBool) -> Result<Film>;
}

/// A structure of any kernel.
pub(super) trait Traced {
    fn camera(&self, scene: &Scene, args: &Args) -> Result<Camera>;
    /// Decides light and integrator as `canted render` does.
    fn choose(&mut self, scene: &mut Scene, camera: &Camera, args: &mut Args, source: LightSource) -> Result<()>;
    /// Updates the structure to a scene with another pose.
    fn update(&mut self, scene: &Scene) -> Result<()>;
    /// Calls `run` with the device that renders the picture: the CPU where `device` cannot.
    fn with_passes(
        &self,
        picture: &Shot,
        device: &Device,
        run: &mut dyn FnMut(&dyn Passes) -> Result<()>,
    ) -> Result<()>;
    fn heatmap(&self, surfaces: &Surfaces, camera: &Camera, args: &Args) -> Result<Picture>;
    fn hit(&self, surfaces: &Surfaces, ray: &Ray) -> Option<Hit>;
    fn boxes(&self, level: BoxLevel) -> Vec<Obb>;
    fn n_levels(&self) -> u32;
}

/// What determines the samples of a picture, besides the structure.
pub(super) struct Shot<'a> {
    pub(super) surfaces: &'a Surfaces<'a>,
    pub(super) camera: &'a Camera,
    #[cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "only GPUs read it"))]
    pub(super) args: &'a Args,
    pub(super) settings: &'a Settings,
}

impl<K: LaneKernel> Traced for Prepared<K> {
    fn camera(&self, scene: &Scene, args: &Args) -> Result<Camera> {
        args.camera.camera(scene, self, args.size)
    }

    fn choose(&mut self, scene: &mut Scene, camera: &Camera, args: &mut Args, source: LightSource) -> Result<()> {
        let source = render::decided(scene, self, camera, args, source)?;
        render::choose(scene, self, camera, args, source).map(drop)
    }

    fn update(&mut self, scene: &Scene) -> Result<()> {
        Ok(Prepared::update(self, scene, &UpdateOptions::default()).map(drop)?)
    }

    fn with_passes(
        &self,
        picture: &Shot,
        device: &Device,
        run: &mut dyn FnMut(&dyn Passes) -> Result<()>,
    ) -> Result<()> {
        #[cfg(feature = "gpu")]
        if let Some(on_gpu) = device.picture(picture, &self.structure)? {
            return run(&on_gpu);
        }
        let _ = device;
        run(&OnCpu { picture, structure: &self.structure })
    }

    fn heatmap(&self, surfaces: &Surfaces, camera: &Camera, args: &Args) -> Result<Picture> {
        let measure = args.heatmap.ok_or_else(|| anyhow!("no heat map is shown"))?;
        Ok(heatmap(surfaces, &self.structure, camera, args.size, measure, args.heatmap_scale)?.picture)
    }

    fn hit(&self, surfaces: &Surfaces, ray: &Ray) -> Option<Hit> {
        self.structure.closest_hit(ray, &mut Masked::new(surfaces, ()))
    }

    fn boxes(&self, level: BoxLevel) -> Vec<Obb> {
        self.structure.boxes(level)
    }

    fn n_levels(&self) -> u32 {
        self.structure.n_levels()
    }
}

/// Renders on the threads of the CPU.
struct OnCpu<'a, K: LaneKernel> {
    picture: &'a Shot<'a>,
    structure: &'a Structure<K>,
}

impl<K: LaneKernel> Passes for OnCpu<'_, K> {
    fn device(&self) -> &str {
        "cpu"
    }

    fn film(&self, settings: &Settings, cancel: &AtomicBool) -> Result<Film> {
        let monitor = Monitor { progress: &|_, _| {}, finished: &|_| {}, cancel };
        let Shot { surfaces, camera, .. } = *self.picture;
        Ok(resume_with(surfaces, self.structure, camera, settings, Vec::new(), &monitor)?)
    }
}

/// Builds the structure of the options.
pub(super) fn traced(scene: &Scene, args: &Args) -> Result<Box<dyn Traced>> {
    with_kernel!(args.structure.triangles, build(scene, args))
}

fn build<K: LaneKernel + 'static>(scene: &Scene, args: &Args) -> Result<Box<dyn Traced>> {
    let name = load::name(args.scene.as_deref());
    let prepared: Prepared<K> =
        prepare(scene, &args.structure.config(scene)?).map_err(|error| anyhow!("{name}: {error}"))?;
    Ok(Box::new(prepared))
}
