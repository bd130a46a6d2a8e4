//! The rendered scenes.

use anyhow::Result;
use canted_renderer::{Integrator, Pattern, Prepared, Settings, StructureConfig, frame, prepare};
use canted_scene::{Camera, Scene};
use canted_trace::Watertight;

use crate::clock;
use crate::report::effort::Effort;
use crate::report::samples::Samples;
use crate::report::subjects;

/// A scene with a view and its built structure.
pub(super) struct Stage {
    pub(super) name: &'static str,
    /// Whether structures and devices are compared on it.
    pub(super) is_first: bool,
    pub(super) scene: Scene,
    pub(super) camera: Camera,
    pub(super) size: [u32; 2],
    /// A tenth of the scene's diagonal, computed once because renders of few samples are short.
    ao_radius: f32,
    pub(super) prepared: Prepared<Watertight>,
    /// Processor seconds of each build, all threads.
    pub(super) build: Samples,
}

impl Stage {
    pub(super) fn new(name: &'static str, scene: Scene, effort: Effort) -> Result<Self> {
        let mut seconds = vec![];
        let mut prepared = None;
        for _ in 0..effort.pick(1, 3, 5) {
            let (built, took) = clock::time_all(|| prepare::<Watertight>(&scene, &StructureConfig::default()));
            seconds.push(took.cpu);
            prepared = Some(built?);
        }
        let prepared = prepared.ok_or_else(|| anyhow::anyhow!("nothing was built"))?;
        let size = effort.pick([24, 14], [64, 36], [96, 54]);
        let camera = frame(&scene, &prepared.structure, f64::from(size[0]) / f64::from(size[1]));
        let diagonal = scene.bounds_world().extent().into_iter().fold(0.0, f64::hypot);
        #[expect(clippy::cast_possible_truncation, reason = "a length that need not be exact")]
        let ao_radius = (0.1 * diagonal) as f32;
        Ok(Self { name, is_first: false, scene, camera, size, ao_radius, prepared, build: seconds.into() })
    }

    /// Name and picture size.
    pub(super) fn sized(&self) -> String {
        let [width, height] = self.size;
        format!("{}, {width} x {height}", self.name)
    }

    /// Settings of a picture of this stage.
    pub(super) fn settings(&self, integrator: Integrator, pattern: Pattern, samples: u32, seed: u32) -> Settings {
        let [width, height] = self.size;
        // Short paths keep the reference affordable, and both integrators have the same number of bounces.
        let ao_radius = Some(self.ao_radius);
        Settings {
            width,
            height,
            integrator,
            pattern,
            samples,
            seed,
            ao_radius,
            bounces: 3,
            tile: 8,
            ..Settings::default()
        }
    }
}

/// The built-in scene, and Sponza in a full run if available.
pub(super) fn stages(effort: Effort, skipped: &mut Vec<String>) -> Result<Vec<Stage>> {
    let mut stages = vec![Stage { is_first: true, ..Stage::new("built-in", canted_scene::builtin(), effort)? }];
    if effort != Effort::Full {
        skipped.push("Pictures of Sponza: only a full run includes them.".to_owned());
        return Ok(stages);
    }
    match subjects::lit_sponza()? {
        Some(scene) => stages.push(Stage::new("sponza", scene, effort)?),
        None => skipped.push("Pictures of Sponza: the model is not available.".to_owned()),
    }
    Ok(stages)
}
