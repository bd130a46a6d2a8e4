//! Scenes from files, or the built-in one.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use canted_scene::{ReadOptions, Scene, SceneFile};

use crate::{
    output::{self, Named},
    settings,
};

/// The files that a command reads, each with what the command line calls it.
pub(crate) struct Inputs(Vec<(String, PathBuf)>);

impl Inputs {
    /// The scene's own file; of a scene file those, too, that it names.
    ///
    /// # Errors
    /// A scene file that cannot be read, or is wrong.
    pub(crate) fn of(scene: Option<&Path>) -> Result<Self> {
        let Some(path) = scene else { return Ok(Self(Vec::new())) };
        let inputs = Self(Vec::new()).and("SCENE", path);
        if !is_scene_file(path) {
            return Ok(inputs);
        }
        let name = what_it_names(path);
        Ok(scene_file(path)?.files().iter().fold(inputs, |inputs, file| inputs.and(&name, file)))
    }

    /// These, and one more.
    pub(crate) fn and(mut self, name: &str, path: &Path) -> Self {
        self.0.push((name.to_owned(), path.to_owned()));
        self
    }

    /// All of them.
    pub(crate) fn named(&self) -> Vec<Named<'_>> {
        self.0.iter().map(|(name, path)| (&name[..], path.as_path())).collect()
    }
}

/// Refuses outputs that would replace a file that was read because a scene names it.
pub(crate) fn check_outputs(path: Option<&Path>, scene: &Scene, outputs: &[Named]) -> Result<()> {
    let name = path.map(what_it_names).unwrap_or_default();
    let inputs: Vec<Named> = scene.files.iter().map(|file| (&name[..], file.as_path())).collect();
    output::check_distinct(&inputs, outputs)
}

fn what_it_names(scene: &Path) -> String {
    format!("what {} names", scene.display())
}

/// Reads a scene, or makes the built-in one; warnings go to standard error, each once.
pub(crate) fn scene(path: Option<&Path>) -> Result<Scene> {
    scene_at(path, None)
}

/// As [`scene`], posed by its animation at a time in seconds.
pub(crate) fn scene_at(path: Option<&Path>, time: Option<f32>) -> Result<Scene> {
    let Some(path) = path else { return Ok(canted_scene::builtin()) };
    let scene = if is_scene_file(path) {
        check_time(path, time)?;
        scene_file(path)?.load()
    } else {
        canted_scene::read_with(path, &ReadOptions { time })
    };
    let scene = scene.map_err(|error| anyhow!("{error}"))?;
    warn(&scene.warnings);
    Ok(scene)
}

/// Refuses a time for a scene file, whose assets have their own.
pub(crate) fn check_time(scene_file: &Path, time: Option<f32>) -> Result<()> {
    match time {
        None => Ok(()),
        Some(_) => Err(anyhow!("{}: --time poses a glTF file, not a scene file", scene_file.display())),
    }
}

/// Tells what was repaired or left out in a file.
pub(crate) fn warn(warnings: &[String]) {
    for warning in warnings {
        output::to_stderr(&format!("warning: {warning}"));
    }
}

/// Reads a scene file, but nothing that it names; its settings are those that this program knows.
pub(crate) fn scene_file(path: &Path) -> Result<SceneFile> {
    let file = SceneFile::read(path).map_err(|error| anyhow!("{error}"))?;
    settings::check(&file.settings, path)?;
    Ok(file)
}

/// Whether a file's name says that it is a scene file.
pub(crate) fn is_scene_file(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// The scene's name in messages.
pub(crate) fn name(path: Option<&Path>) -> String {
    path.map_or_else(|| "built-in scene".to_owned(), |path| path.display().to_string())
}
