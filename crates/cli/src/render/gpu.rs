//! Renders films on the GPU, alone or together with the CPU.

use anyhow::{Result, anyhow};
use canted_film::{Film, Tile};
use canted_gpu::{Gpu, Traffic};
use canted_renderer::{
    DeviceFrames, DevicePicture, FirstHit, Integrator, Monitor, SceneBvh, SharedFilm, Surfaces, traced_scene,
};
use canted_scene::{Camera, Scene};
use serde_json::json;

use super::{facts::Fact, film::FilmRenderer};
use crate::{
    device::{Machine, built_or, named},
    output,
    settings::Plan,
};

/// Renders on the GPU.
pub(super) struct GpuRenderer<'a> {
    gpu: &'a Gpu,
    picture: DevicePicture<'a>,
    with_cpu: bool,
    /// How first hits are found, where the integrator has a choice.
    first_hit: Option<FirstHit>,
    /// What had gone to the GPU before the scene.
    before: Traffic,
}

impl<'a> GpuRenderer<'a> {
    /// Uploads the scene, or what changed since the last of these frames; `None` where the CPU renders alone.
    ///
    /// # Errors
    /// A GPU that was requested explicitly does not support the scene or the settings.
    pub(super) fn new(
        machine: &'a Machine,
        plan: &'a Plan,
        surfaces: &'a Surfaces<'a>,
        bvh: &'a SceneBvh,
        camera: &Camera,
        frames: Option<&'a mut DeviceFrames>,
    ) -> Result<Option<Self>> {
        if !machine.has_gpu() {
            return Ok(None);
        }
        let settings = &plan.settings;
        let with_cpu = matches!(machine, Machine::Both(_));
        if settings.part.is_some() && with_cpu {
            return Err(anyhow!("--samples requires one device; --device both mixes CPU and GPU rounding"));
        }
        let before = machine.gpu().map(Gpu::traffic).unwrap_or_default();
        let config = &plan.structure.config;
        let ready = machine.ready(&plan.structure, |gpu| {
            let picture = match (frames, plan.structure.built_on_gpu) {
                (Some(frames), _) => DevicePicture::in_frame(gpu, surfaces, bvh, camera, settings, frames)?,
                (None, Some(own)) => {
                    let make = |scene: &Scene| built_or(gpu, scene, config, own, || traced_scene(gpu, scene, bvh));
                    DevicePicture::over(gpu, surfaces, bvh, camera, settings, make)?
                }
                (None, None) => DevicePicture::new(gpu, surfaces, bvh, camera, settings)?,
            };
            picture.with_first_hit(plan.first_hit)
        })?;
        let has_choice = settings.integrator == Integrator::Hybrid;
        Ok(ready.map(|(gpu, (picture, first_hit))| Self {
            gpu,
            picture,
            with_cpu,
            first_hit: has_choice.then_some(first_hit),
            before,
        }))
    }
}

impl GpuRenderer<'_> {
    /// How the GPU took this picture, and what went there and came back.
    fn facts(&self) -> Vec<Fact> {
        let Traffic { uploaded_bytes, n_dispatches, downloaded_bytes, .. } = self.gpu.traffic() - self.before;
        let mut facts = vec![
            ("gpu_uploaded_bytes", json!(uploaded_bytes)),
            ("gpu_downloaded_bytes", json!(downloaded_bytes)),
            ("gpu_dispatches", json!(n_dispatches)),
        ];
        facts.extend(self.picture.without_streams().map(|reason| ("gpu_without_streams", json!(reason))));
        facts.extend(self.picture.n_exact_rays().map(|n| ("gpu_exact_rays", json!(n))));
        facts
    }
}

impl FilmRenderer for GpuRenderer<'_> {
    fn device(&self) -> String {
        let name = &self.gpu.info().name;
        if self.with_cpu { format!("cpu and {name}") } else { name.clone() }
    }

    fn render(&self, done: Vec<Tile>, monitor: &Monitor, facts: &mut Vec<Fact>) -> Result<Film> {
        let named = |error| named(self.gpu, error);
        facts.extend(self.first_hit.map(|first_hit| ("first_hit", json!(first_hit.name()))));
        if !self.with_cpu {
            let film = self.picture.render(done, monitor).map_err(named);
            facts.extend(self.facts());
            return film;
        }
        let SharedFilm { film, n_tiles_of_device, stopped } =
            self.picture.render_with_cpu(done, monitor).map_err(named)?;
        facts.extend(self.facts());
        facts.push(("gpu_tiles", json!(n_tiles_of_device)));
        if let Some(error) = stopped {
            let name = &self.gpu.info().name;
            output::warn(&format!("the CPU rendered the remaining tiles: {name}: {error}"));
        }
        Ok(film)
    }
}
