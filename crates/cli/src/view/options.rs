//! The options of a session: those of `canted render` that it starts from and that events change.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_film::Aov;
use canted_renderer::BoxLevel;
use canted_scene::{Camera, Lens, Projection, SceneFile};
use serde::Serialize;

use crate::{
    camera::{CameraArgs, LensArgs},
    device::DeviceArg,
    light::LightArgs,
    options::{Given, StructureOptions, Text, flag, given},
    picture,
    render::DiagramArgs,
    settings::{self, LookOptions, PictureArgs, Plan, Purpose},
};

/// The options of `canted render` that a session has.
pub(crate) type SessionArgs = PictureArgs<ScreenArgs>;

/// What is shown besides light, and what renders it.
#[derive(clap::Args, Clone, Debug, PartialEq, Serialize)]
pub(crate) struct ScreenArgs {
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) diagram: Given<DiagramArgs>,
    /// Compute device: cpu, gpu, auto, or part of an adapter name (see `canted devices`). The CPU renders coarse pictures, heat maps and what
    /// the device does not support.
    #[arg(long, help_heading = "Run", default_value = "cpu", value_name = "DEVICE")]
    #[serde(serialize_with = "device_text")]
    pub(crate) device: DeviceArg,
}

fn device_text<S: serde::Serializer>(device: &DeviceArg, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&device.text())
}

/// The scene and the options of a picture.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    args: SessionArgs,
    /// The scene file, if the scene is one.
    file: Option<SceneFile>,
    /// The channel that is shown in place of light.
    pub(crate) aov: Option<Aov>,
}

/// What determines meshes and lights, besides the time.
pub(super) type SceneKey = (Option<String>, Option<String>, LightArgs);

/// What determines the film: all but exposure, tone curve and boxes.
#[derive(PartialEq)]
pub(super) struct FilmKey(SessionArgs, Option<Aov>);

impl Options {
    /// Options as on the command line.
    ///
    /// # Errors
    /// One sentence: a scene file that is unreadable, or options that contradict each other.
    pub(super) fn new(args: SessionArgs) -> Result<Self> {
        let file = settings::scene_file(args.source.scene.as_deref())?;
        let options = Self { args, file, aov: None };
        options.check()?;
        Ok(options)
    }

    /// The options by their types.
    pub(crate) fn args(&self) -> &SessionArgs {
        &self.args
    }

    /// The file of the scene; `None` for the built-in scene.
    pub(super) fn scene(&self) -> Option<&Path> {
        self.args.source.scene.as_deref()
    }

    /// Sets the size of the picture.
    #[cfg(feature = "view")]
    pub(super) fn set_size(&mut self, size: [u32; 2]) {
        self.args.options.0.size = Some(size);
    }

    /// The boxes that are shown.
    pub(super) fn boxes(&self) -> Option<BoxLevel> {
        self.args.own.diagram.0.boxes
    }

    /// Whether neither eye nor target is given.
    pub(super) fn has_file_camera(&self) -> bool {
        self.args.camera.eye.is_none() && self.args.camera.target.is_none()
    }

    /// The picture of the options.
    pub(super) fn plan(&self) -> Result<Plan> {
        let purpose = Purpose { heatmap: self.args.own.diagram.0.measure(), ..Purpose::default() };
        self.args.clone().resolve(self.file.as_ref(), &purpose)
    }

    /// Rejects options that contradict each other, and a device that a session cannot have.
    fn check(&self) -> Result<()> {
        self.plan()?;
        match self.args.own.device {
            DeviceArg::Both(_) => {
                Err(anyhow!("--device both requires `canted render`; use cpu, gpu or an adapter name"))
            }
            _ => Ok(()),
        }
    }

    /// Sets options by name, or none of them if one is unknown or has an invalid value; an empty value returns an option to its default.
    /// Beside the options of a picture there is `aov`, a channel or `none`. `heatmap` and `boxes` may be `none`.
    pub(super) fn set_all(&mut self, changes: &[(String, String)]) -> Result<()> {
        let mut changed = self.clone();
        let mut words = given(&self.args);
        for (name, value) in changes {
            let name = name.replace('-', "_");
            let value = match (&name[..], &value[..]) {
                ("aov", value) => {
                    changed.aov = if ["", "none"].contains(&value) { None } else { Some(channel(value)?) };
                    continue;
                }
                ("heatmap" | "boxes", "none") => "",
                (_, value) => value,
            };
            words.retain(|(known, _)| *known != name);
            if !value.is_empty() {
                words.push((name, value.to_owned()));
            }
        }
        // The scale of a heat map that is not shown is kept for the next one.
        let has = |name: &str| words.iter().any(|(known, _)| known == name);
        let is_hidden = has("heatmap_scale") && !has("heatmap");
        words.extend(is_hidden.then(|| ("heatmap".to_owned(), "boxes".to_owned())));
        changed.args = picture::parse(self.scene(), &words, |_| true)?;
        if is_hidden {
            changed.args.own.diagram.0.heatmap = None;
        }
        changed.check()?;
        *self = changed;
        Ok(())
    }

    /// Sets the options that give exactly this camera. `up` is set only if it was given before, since it sets the default light, too.
    pub(super) fn set_camera(&mut self, camera: &Camera) {
        let own = &mut self.args.camera;
        (own.eye, own.target) = (Some(camera.eye), Some(camera.target));
        (own.fov, own.ortho) = match camera.projection {
            Projection::Perspective { fov_degrees } => (Some(fov_degrees), None),
            Projection::Orthographic { height } => (None, Some(height)),
        };
        if let Some(Lens { radius, focus_distance }) = camera.lens {
            own.lens = LensArgs { aperture: Some(radius), focus: Some(focus_distance) };
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
        (source.animation.clone(), source.variant.clone(), self.args.light.clone())
    }

    /// What determines the structure, besides the scene.
    pub(super) fn structure_key(&self) -> &StructureOptions {
        &self.args.structure.0
    }

    pub(super) fn film_key(&self) -> FilmKey {
        let mut args = self.args.clone();
        args.options.0.look = LookOptions::default();
        args.own.diagram.0.boxes = None;
        FilmKey(args, self.aov)
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
        let has_heatmap = self.args.own.diagram.0.heatmap.is_some();
        let is_shown = |name: &str| name != "device" && (has_heatmap || name != "heatmap_scale");
        for (name, value) in given(&self.args).into_iter().filter(|(name, _)| is_shown(name)) {
            line += &format!(" {}={}", flag(&name), quoted(&value));
        }
        match self.aov {
            Some(aov) => line + &format!(" --aovs={} -o canted.exr", aov.name()),
            None => line + " -o canted.png",
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
        assert_eq!(options.command("cpu"), "canted render --device=cpu -o canted.png");
        options.set_all(&[change("heatmap_scale", "64")]).unwrap();
        options.set_all(&[change("heatmap", "boxes")]).unwrap();
        assert_eq!(
            options.command("cpu"),
            "canted render --device=cpu --heatmap=boxes --heatmap-scale=64 -o canted.png"
        );
    }
}
