//! The scene of each frame.

use std::collections::BTreeSet;

use anyhow::{Result, anyhow};
use canted_film::Record;
use canted_scene::{AnimatedScene, Environment, Light, Scene};

use super::{super::Args, kept};
use crate::{device::Machine, light, load, output};

/// A scene that is posed for each frame.
pub(super) struct Source {
    animated: Option<AnimatedScene>,
    pub(super) scene: Scene,
    /// The lights of the file, where poses do not set them.
    lights: Vec<Light>,
    /// The environment that the light options or the file set; `None` where the default light may be needed.
    environment: Option<Environment>,
    /// Kinds of warnings that were printed.
    warned: BTreeSet<String>,
}

impl Source {
    /// Reads the scene at the time of the first frame.
    pub(super) fn open(args: &Args, time: f32) -> Result<Self> {
        let path = args.scene.as_deref();
        let (animated, scene) = match path {
            Some(path) if !load::is_scene_file(path) => {
                // A file without animation is read in its rest pose.
                let options = args.read_options(Some(time));
                let (animated, scene) = AnimatedScene::open(path, &options)?;
                if !animated.is_animated() && args.sequence.turntable.is_none() {
                    output::warn(&format!(
                        "{}: the file has no animation; all frames show its rest pose",
                        path.display()
                    ));
                }
                (Some(animated).filter(AnimatedScene::is_animated), scene)
            }
            Some(path) if args.sequence.turntable.is_none() => {
                return Err(anyhow!(
                    "{}: --frames requires a glTF file or --turntable; a scene file sets the time of each asset",
                    path.display()
                ));
            }
            None if args.sequence.turntable.is_none() => {
                return Err(anyhow!("--frames of the built-in scene requires --turntable"));
            }
            _ => (None, load::scene_with(path, &args.read_options(None))?),
        };
        let mut source =
            Self { animated, lights: scene.lights.clone(), environment: None, scene, warned: BTreeSet::new() };
        source.environment = args.light.environment_or(source.scene.environment.take())?;
        source.warn();
        Ok(source)
    }

    /// What the records of all frames share.
    pub(super) fn shared_record(&mut self, args: &Args, machine: &Machine) -> Result<Record> {
        self.scene.environment.clone_from(&self.environment);
        kept::shared(args, &mut self.scene, machine.name())
    }

    /// Sets the scene to a time in seconds.
    pub(super) fn pose(&mut self, args: &Args, time: f32) -> Result<light::LightSource> {
        match (&mut self.animated, args.sequence.shutter_times(time)) {
            (Some(animated), None) => animated.pose(time, &mut self.scene)?,
            (Some(animated), Some(times)) => animated.pose_shutter(times, &mut self.scene)?,
            (None, _) => self.scene.lights.clone_from(&self.lights),
        }
        self.warn();
        // The environment is set again, because the default light of the last frame may have replaced it.
        if self.scene.environment.is_none() || self.environment.is_none() {
            self.scene.environment.clone_from(&self.environment);
        }
        args.light.apply_lights(&mut self.scene)
    }

    /// Prints new kinds of warnings: what stands before the first colon and the values.
    fn warn(&mut self) {
        for warning in std::mem::take(&mut self.scene.warnings) {
            let kind = warning.split(": ").next().unwrap_or_default().to_owned();
            if self.warned.insert(kind) {
                output::warn(&warning);
            }
        }
    }
}
