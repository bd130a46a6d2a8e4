//! The options of a session: those of `canted render` that it starts from and that events change.

use std::{path::Path, sync::Arc};

use anyhow::{Result, anyhow};
use canted_film::Aov;
use canted_renderer::{BoxLevel, Measure};
use canted_scene::{Camera, Lens, Projection, SceneFile};
use serde::{Deserialize, Serialize};

use crate::{
    camera::{CameraArgs, LensArgs},
    device::DeviceArg,
    light::{LightArgs, Preset},
    options::{self, Given, StructureOptions, Value, flag, given},
    render::DiagramArgs,
    settings::{self, LookOptions, PictureArgs, Plan, Purpose, SceneArgs},
};

/// The options of `canted render` that a session has.
pub(crate) type SessionArgs = PictureArgs<Given<ScreenArgs>>;

/// What is shown besides light, and what renders it.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(crate) struct ScreenArgs {
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) diagram: DiagramArgs,
    /// Compute device: cpu, gpu, auto, or part of an adapter name (see `canted devices`). The CPU renders coarse pictures, heat maps and what
    /// the device does not support.
    #[arg(long, help_heading = "Run", default_value = "cpu", value_name = "DEVICE")]
    pub(crate) device: Option<Value<DeviceArg>>,
}

/// The scene and the options of a picture.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    pub(super) args: SessionArgs,
    /// The scene file, if the scene is one.
    file: Option<Arc<SceneFile>>,
    /// The channel that is shown in place of light.
    pub(super) aov: Option<Aov>,
}

/// What determines meshes and lights, besides the time.
pub(super) type SceneKey = (SceneArgs, LightArgs, Option<Value<Preset>>);

/// What determines the film: all but exposure, tone curve and boxes.
#[derive(PartialEq)]
pub(super) struct FilmKey(SessionArgs, Option<Aov>, bool);

impl PartialEq for Options {
    /// The scene file is always that of `args`.
    fn eq(&self, other: &Self) -> bool {
        (&self.args, self.aov) == (&other.args, other.aov)
    }
}

impl Options {
    /// Options as on the command line.
    ///
    /// # Errors
    /// One sentence: a scene file that is unreadable, or options that contradict each other.
    pub(super) fn new(args: SessionArgs) -> Result<Self> {
        let file = settings::scene_file(args.source.scene.as_deref())?.map(Arc::new);
        let options = Self { args, file, aov: None };
        options.check()?;
        Ok(options)
    }

    /// The file of the scene; `None` for the built-in scene.
    pub(super) fn scene(&self) -> Option<&Path> {
        self.args.source.scene.as_deref()
    }

    /// What is drawn in place of light and over it.
    pub(super) fn diagram(&mut self) -> &mut DiagramArgs {
        &mut self.args.own.0.diagram
    }

    /// The boxes that are shown.
    pub(super) fn boxes(&self) -> Option<BoxLevel> {
        self.args.own.0.diagram.boxes()
    }

    /// What the heat map that is shown measures.
    pub(super) fn measure(&self) -> Option<Measure> {
        self.args.own.0.diagram.heatmap.map(|measure| measure.0)
    }

    /// The device that is asked for.
    pub(super) fn device(&self) -> &DeviceArg {
        self.args.own.0.device.as_ref().map_or(&DeviceArg::Cpu, |device| &device.0)
    }

    /// Whether neither eye nor target is given.
    pub(super) fn has_file_camera(&self) -> bool {
        self.args.camera.eye.is_none() && self.args.camera.target.is_none()
    }

    /// The picture of the options.
    pub(super) fn plan(&self) -> Result<Plan> {
        let diagram = &self.args.own.0.diagram;
        let shows_data = self.aov.is_some() || diagram.boxes.is_some();
        let purpose = Purpose { heatmap: diagram.measure(), shows_data, ..Purpose::default() };
        self.args.clone().resolve(self.file.as_deref(), &purpose)
    }

    /// Rejects options that contradict each other, and a device that a session cannot have. What one command line may not contain is
    /// rejected here, too: changes come one by one.
    pub(super) fn check(&self) -> Result<()> {
        let SessionArgs { source, camera, light, .. } = &self.args;
        let of_scene = [
            ("--time", source.time.is_some()),
            ("--animation", source.animation.is_some()),
            ("--variant", source.variant.is_some()),
            ("--texture-path", !source.files.texture_path.is_empty()),
            ("--allow-parent", source.files.allow_parent.is_some()),
            ("--line-radius", source.files.line_radius.is_some()),
            ("--point-radius", source.files.point_radius.is_some()),
            ("--camera", camera.camera.is_some()),
        ];
        if let Some((option, _)) = of_scene.into_iter().find(|&(_, is_given)| is_given && source.scene.is_none()) {
            return Err(anyhow!("{option} requires a scene"));
        }
        if camera.fov.is_some() && camera.ortho.is_some() {
            return Err(anyhow!("--fov and --ortho cannot be used together"));
        }
        light.check()?;
        if matches!(self.device(), DeviceArg::Both(_)) {
            return Err(anyhow!("--device both requires `canted render`; use cpu, gpu or an adapter name"));
        }
        self.plan().map(drop)
    }

    /// Sets options by name, or none of them if one is unknown or has an invalid value; an empty value returns an option to its default.
    /// Beside the options of a picture there is `aov`, a channel or `none`. `heatmap` and `boxes` may be `none`.
    pub(super) fn set_all(&mut self, changes: &[(String, String)]) -> Result<()> {
        let (mut aov, mut of_args) = (self.aov, Vec::new());
        for (name, text) in changes {
            match (&name[..], &text[..]) {
                ("aov", "" | "none") => aov = None,
                ("aov", text) => aov = Some(channel(text)?),
                ("heatmap" | "boxes", "none") => of_args.push((name.clone(), String::new())),
                _ => of_args.push((name.clone(), text.clone())),
            }
        }
        let mut args = options::changed(&self.args, &of_args)?;
        args.source.scene.clone_from(&self.args.source.scene);
        let changed = Self { args, file: self.file.clone(), aov };
        changed.check()?;
        *self = changed;
        Ok(())
    }

    /// Whether these options differ from others in the time alone.
    pub(super) fn has_other_time_than(&self, other: &Self) -> bool {
        let mut at_its_time = self.clone();
        at_its_time.args.source.time = other.args.source.time;
        self != other && at_its_time == *other
    }

    /// Sets the options that give exactly this camera. `up` is set only if it was given before, since it sets the default light, too.
    pub(super) fn set_camera(&mut self, camera: &Camera) {
        let own = &mut self.args.camera;
        (own.eye, own.target) = (Some(Value(camera.eye)), Some(Value(camera.target)));
        (own.fov, own.ortho) = match camera.projection {
            Projection::Perspective { fov_degrees } => (Some(Value(fov_degrees)), None),
            Projection::Orthographic { height } => (None, Some(Value(height))),
        };
        if let Some(Lens { radius, focus_distance }) = camera.lens {
            own.lens = LensArgs { aperture: Some(Value(radius)), focus: Some(Value(focus_distance)) };
        }
    }

    /// Whether the camera is that of other options.
    pub(super) fn has_camera_of(&self, other: &Self) -> bool {
        let own = |options: &Self| CameraArgs { camera: None, ..options.args.camera.clone() };
        let framing = |options: &Self| {
            let SessionArgs { source, options: Given(picture), camera, .. } = &options.args;
            (picture.size, picture.up_axis, camera.camera.clone(), source.animation.clone())
        };
        let is_framed = self.args.camera.eye.is_none() || self.args.camera.target.is_none();
        own(self) == own(other) && (!is_framed || framing(self) == framing(other))
    }

    /// Gives the options of the camera the values that they have in `start`.
    pub(super) fn reset_camera(&mut self, start: &Self) {
        let camera = self.args.camera.camera.take();
        self.args.camera = CameraArgs { camera, ..start.args.camera.clone() };
    }

    pub(super) fn scene_key(&self) -> SceneKey {
        let source = &self.args.source;
        let light = self.args.options.0.stage.light;
        (SceneArgs { scene: None, time: None, ..source.clone() }, self.args.light.clone(), light)
    }

    /// What determines the structure, besides the scene.
    pub(super) fn structure_key(&self) -> &StructureOptions {
        &self.args.structure.0
    }

    pub(super) fn film_key(&self) -> FilmKey {
        let mut args = self.args.clone();
        args.options.0.look = LookOptions::default();
        // Boxes are drawn over the film, but a scene with boxes has no ground.
        let has_boxes = args.own.0.diagram.boxes.take().is_some();
        FilmKey(args, self.aov, has_boxes)
    }

    /// The command line that renders this picture on a device, for a POSIX shell. A channel is written as it is, to an EXR.
    pub(super) fn command(&self, device: &str) -> String {
        let mut line = "canted render".to_owned();
        if let Some(scene) = self.scene() {
            let path = scene.display().to_string();
            let path = if path.starts_with('-') { format!("./{path}") } else { path };
            line += &format!(" {}", quoted(&path));
        }
        line += &format!(" --device={}", quoted(device));
        let has_heatmap = self.measure().is_some();
        let is_shown = |name: &str| name != "device" && (has_heatmap || name != "heatmap_scale");
        for (name, value) in given(&self.args).into_iter().filter(|(name, _)| is_shown(name)) {
            line += &format!(" {}={}", flag(&name), quoted(&value));
        }
        match self.aov {
            Some(aov) => line + &format!(" --aovs={} -o canted.exr", aov.name()),
            None if has_heatmap => line + " -o canted.png",
            // What is shown is not denoised.
            None => line + " --denoise=off -o canted.png",
        }
    }
}

/// A channel by name.
fn channel(name: &str) -> Result<Aov> {
    let found = Aov::ALL.into_iter().find(|aov| aov.name() == name);
    let all = Aov::ALL.map(Aov::name).join(", ");
    found.ok_or_else(|| anyhow!("unknown channel '{}'; use {all} or none", name.escape_debug()))
}

/// A word of a command line, in quotes where a shell needs them.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_./,:=+-@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_quoted_for_shells() {
        assert_eq!(quoted("a/b-1.obj"), "a/b-1.obj");
        assert_eq!(quoted("it's mine"), "'it'\\''s mine'");
        assert_eq!(quoted(""), "''");
    }

    #[test]
    fn changes_apply_together_or_not_at_all() {
        let mut options = Options::new(crate::options::defaults()).unwrap();
        let change = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        options.set_all(&[change("tone-map", "agx"), change("spp", "2"), change("aov", "depth")]).unwrap();
        assert_eq!(
            options.command("cpu"),
            "canted render --device=cpu --spp=2 --tone-map=agx --aovs=depth -o canted.exr"
        );
        let before = options.command("cpu");
        for wrong in [change("spp", "x"), change("spq", "1"), change("output", "a.png"), change("aov", "z")] {
            assert!(options.set_all(&[change("seed", "1"), wrong.clone()]).is_err(), "{wrong:?}");
        }
        assert_eq!(options.command("cpu"), before);
        options.set_all(&[change("spp", ""), change("aov", "none"), change("tone_map", "")]).unwrap();
        assert_eq!(options.command("cpu"), "canted render --device=cpu --denoise=off -o canted.png");
        options.set_all(&[change("heatmap_scale", "64")]).unwrap();
        options.set_all(&[change("heatmap", "boxes")]).unwrap();
        assert_eq!(
            options.command("cpu"),
            "canted render --device=cpu --heatmap=boxes --heatmap-scale=64 -o canted.png"
        );
    }
}
