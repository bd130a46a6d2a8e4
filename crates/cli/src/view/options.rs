//! The options of a session: those of `canted render` that it starts from and that events change.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use anyhow::Result;
use canted_film::Aov;
use canted_scene::{Camera, Lens, Projection, SceneFile};

use super::device;
use crate::{load, picture, render, settings};

/// Options that determine which geometry and lights there are, besides the time.
const OF_SCENE: [&str; 8] = ["animation", "variant", "env", "env_turn", "env_scale", "sun", "point", "sphere"];

/// Options that determine the acceleration structure.
const OF_STRUCTURE: [&str; 6] = ["levels", "accel", "preset", "builder", "volumes", "triangles"];

/// Options that apply to a finished film.
const OF_LOOK: [&str; 3] = ["exposure", "tone_map", "boxes"];

/// Options that choose a camera where neither eye nor target is given.
const OF_FRAMING: [&str; 4] = ["size", "camera", "up_axis", "animation"];

/// Options that a moving camera sets.
const OF_CAMERA: [&str; 7] = ["eye", "target", "up", "fov", "ortho", "aperture", "focus"];

/// Whether `canted view` has an option of `canted render`.
pub(super) fn is_option(id: &str) -> bool {
    let is_more = || OF_LOOK.contains(&id) || ["heatmap", "heatmap_scale", "device"].contains(&id);
    settings::is_of_picture(id) && id != "aovs" || is_more()
}

/// The scene and the options of a picture, by name in the order in which they were set.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    scene: Option<PathBuf>,
    /// The scene file, if the scene is one.
    file: Option<SceneFile>,
    words: Vec<(String, String)>,
    /// The channel that is shown in place of light.
    pub(crate) aov: Option<Aov>,
}

impl Options {
    /// Options as on the command line.
    ///
    /// # Errors
    /// One sentence: a scene file that is unreadable, or an invalid option.
    pub(super) fn new(scene: Option<PathBuf>, words: Vec<(String, String)>) -> Result<Self> {
        let file = scene.as_deref().filter(|path| load::is_scene_file(path)).map(load::scene_file).transpose()?;
        let options = Self { scene, file, words, aov: None };
        device::check(&options.args()?)?;
        Ok(options)
    }

    /// The file of the scene; `None` for the built-in scene.
    pub(super) fn scene(&self) -> Option<&Path> {
        self.scene.as_deref()
    }

    /// The value of an option that was given or set.
    pub(super) fn get(&self, id: &str) -> Option<&str> {
        self.words.iter().rfind(|(name, _)| name == id).map(|(_, value)| &value[..])
    }

    /// Sets an option; an empty value returns it to its default.
    pub(super) fn set(&mut self, id: &str, value: &str) {
        self.words.retain(|(name, _)| name != id);
        if !value.is_empty() {
            self.words.push((id.to_owned(), value.to_owned()));
        }
    }

    /// Sets options, or none of them if one is unknown or has an invalid value. Beside the options of a picture there is `aov`, a channel
    /// or `none`. `heatmap` and `boxes` may be `none`.
    pub(super) fn set_all(&mut self, changes: &[(String, String)]) -> Result<()> {
        let mut changed = self.clone();
        for (name, value) in changes {
            match (&name.replace('-', "_")[..], &value[..]) {
                ("aov", "" | "none") => changed.aov = None,
                ("aov", _) => changed.aov = Some(channel(value)?),
                ("heatmap" | "boxes", "none") => changed.set(&name.replace('-', "_"), ""),
                (id, _) => changed.set(id, value),
            }
        }
        let args = changed.args()?;
        args.settings()?;
        device::check(&args)?;
        *self = changed;
        Ok(())
    }

    /// Sets the options that give exactly this camera. `up` is set only if it was given before, since it sets the default light, too.
    pub(super) fn set_camera(&mut self, camera: &Camera) {
        let triple = |[x, y, z]: [f32; 3]| format!("{x},{y},{z}");
        self.set("eye", &triple(camera.eye));
        self.set("target", &triple(camera.target));
        let (fov, ortho) = match camera.projection {
            Projection::Perspective { fov_degrees } => (fov_degrees.to_string(), String::new()),
            Projection::Orthographic { height } => (String::new(), height.to_string()),
        };
        self.set("fov", &fov);
        self.set("ortho", &ortho);
        if let Some(Lens { radius, focus_distance }) = camera.lens {
            self.set("aperture", &radius.to_string());
            self.set("focus", &focus_distance.to_string());
        }
    }

    /// Whether options leave the camera as it is.
    pub(super) fn keep_camera(&self, changes: &[(String, String)]) -> bool {
        let is_framed = self.get("eye").is_none() || self.get("target").is_none();
        changes.iter().all(|(name, _)| {
            let id = &name.replace('-', "_")[..];
            !(OF_CAMERA.contains(&id) || is_framed && OF_FRAMING.contains(&id))
        })
    }

    /// Gives the options of the camera the values that they have in `start`.
    pub(super) fn reset_camera(&mut self, start: &Self) {
        for id in OF_CAMERA {
            self.set(id, start.get(id).unwrap_or_default());
        }
    }

    /// The options as `canted render` has them.
    pub(super) fn args(&self) -> Result<render::Args> {
        picture::parse(self.file.as_ref(), self.scene.as_deref(), &self.effective(), is_option)
    }

    /// The options without the scale of a heat map that is not shown. The device is the CPU unless another one is given.
    fn effective(&self) -> Vec<(String, String)> {
        let has_heatmap = self.get("heatmap").is_some();
        let device = ("device".to_owned(), "cpu".to_owned());
        let default = [device].into_iter().filter(|_| self.get("device").is_none());
        default.chain(self.words.iter().filter(|(name, _)| has_heatmap || name != "heatmap_scale").cloned()).collect()
    }

    /// What determines meshes and lights.
    pub(super) fn scene_key(&self) -> String {
        self.key(|id| OF_SCENE.contains(&id))
    }

    /// What determines the structure, besides the scene.
    pub(super) fn structure_key(&self) -> String {
        self.key(|id| OF_STRUCTURE.contains(&id))
    }

    /// What determines the film: all but exposure and tone curve.
    pub(super) fn film_key(&self) -> String {
        format!("{}{:?}", self.key(|id| !OF_LOOK.contains(&id)), self.aov)
    }

    fn key(&self, is_part: impl Fn(&str) -> bool) -> String {
        self.words.iter().filter(|(id, _)| is_part(id)).fold(String::new(), |mut key, (id, value)| {
            let _ = write!(key, "{id}={value:?} ");
            key
        })
    }

    /// The command line that renders this picture on a device, for a POSIX shell. A channel is written as it is, to an EXR.
    pub(super) fn command(&self, device: &str) -> String {
        let mut line = "canted render".to_owned();
        if let Some(scene) = &self.scene {
            let path = scene.display().to_string();
            let path = if path.starts_with('-') { format!("./{path}") } else { path };
            line += &format!(" {}", quoted(&path));
        }
        line += &format!(" --device={}", quoted(device));
        for (id, value) in self.effective().into_iter().filter(|(id, _)| id != "device") {
            line += &format!(" --{}={}", id.replace('_', "-"), quoted(&value));
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
    found.ok_or_else(|| anyhow::anyhow!("unknown channel '{}'; use {all} or none", name.escape_debug()))
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
        let mut options = Options::new(None, vec![("spp".to_owned(), "4".to_owned())]).unwrap();
        let change = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        options.set_all(&[change("tone-map", "agx"), change("spp", "2"), change("aov", "depth")]).unwrap();
        assert_eq!(
            options.command("cpu"),
            "canted render --device=cpu --tone-map=agx --spp=2 --aovs=depth -o canted.exr"
        );
        let before = options.command("cpu");
        for wrong in [change("spp", "x"), change("spq", "1"), change("output", "a.png"), change("aov", "z")] {
            assert!(options.set_all(&[change("seed", "1"), wrong.clone()]).is_err(), "{wrong:?}");
        }
        assert_eq!(options.command("cpu"), before);
        options.set_all(&[change("spp", ""), change("aov", "none"), change("tone_map", "")]).unwrap();
        assert_eq!(options.command("cpu"), "canted render --device=cpu -o canted.png");
    }
}
