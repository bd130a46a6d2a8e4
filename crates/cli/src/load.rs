//! Scenes from files, or the built-in scene.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use canted_scene::{AnimatedScene, ReadError, ReadOptions, Scene, SceneFile};
use serde::{Deserialize, Serialize};

use crate::{
    options::{self, NotNegative, Value},
    output::{self, Named},
};

/// Which files a scene may refer to. Scene files state it for each asset.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(crate) struct FileArgs {
    /// Folder of images that are neither where the file says nor beside it; repeatable.
    #[arg(long, requires = "scene", value_name = "DIR")]
    #[serde(default)]
    pub(crate) texture_path: Vec<PathBuf>,
    /// Read files outside the folder of the scene, to which it refers by `../`: on or off [default: off]
    #[arg(long, requires = "scene", num_args = 0..=1, require_equals = true, default_missing_value = "on", value_name = "on|off")]
    pub(crate) allow_parent: Option<Value<bool>>,
    /// Radius of lines for which the file states none; with OBJ, PLY and glTF, lines are read in place of faces [default: 0.2 for .gcode, 0.1
    /// for .pdb and .xyz, a two-thousandth of the extent for .tck and .trk]
    #[arg(long, requires = "scene", value_name = "LENGTH")]
    pub(crate) line_radius: Option<Value<NotNegative>>,
    /// Radius of points, which become balls, and of lines without --line-radius; with OBJ, PLY and glTF, in place of faces [default for .pdb and
    /// .xyz: half the covalent radius]
    #[arg(long, requires = "scene", value_name = "LENGTH")]
    pub(crate) point_radius: Option<Value<NotNegative>>,
}

impl FileArgs {
    /// Whether files outside the folder of the scene are permitted.
    pub(crate) fn allows_parent(&self) -> bool {
        self.allow_parent.is_some_and(|is_on| is_on.0)
    }

    /// How a file is read, in a pose.
    pub(crate) fn read_options(&self, time: Option<f32>, animation: Option<&str>) -> ReadOptions {
        // Without `..`, so that a new option cannot be forgotten.
        let Self { texture_path, allow_parent: _, line_radius, point_radius } = self;
        let [line_radius, point_radius] = [line_radius, point_radius].map(|radius| radius.map(|radius| radius.0));
        let (animation, allow_parent) = (animation.map(str::to_owned), self.allows_parent());
        let texture_paths = texture_path.clone();
        ReadOptions { time, animation, variant: None, texture_paths, allow_parent, line_radius, point_radius }
    }
}

/// The files that a command reads, each with its name on the command line.
pub(crate) struct Inputs(Vec<(String, PathBuf)>);

impl Inputs {
    /// The file of the scene, and the files that a scene file refers to.
    ///
    /// # Errors
    /// A scene file that is unreadable or invalid.
    pub(crate) fn of(scene: Option<&Path>) -> Result<Self> {
        let Some(path) = scene else { return Ok(Self(Vec::new())) };
        let inputs = Self(Vec::new()).and("SCENE", path);
        if !is_scene_file(path) {
            return Ok(inputs);
        }
        let name = input_of(path);
        Ok(scene_file(path)?.files().iter().fold(inputs, |inputs, file| inputs.and(&name, file)))
    }

    /// Adds a file.
    pub(crate) fn and(mut self, name: &str, path: &Path) -> Self {
        self.0.push((name.to_owned(), path.to_owned()));
        self
    }

    /// All files.
    pub(crate) fn named(&self) -> Vec<Named<'_>> {
        self.0.iter().map(|(name, path)| (&name[..], path.as_path())).collect()
    }
}

/// Rejects outputs that would replace a file that the scene refers to.
pub(crate) fn check_outputs(path: Option<&Path>, scene: &Scene, outputs: &[Named]) -> Result<()> {
    let name = path.map(input_of).unwrap_or_default();
    let inputs: Vec<Named> = scene.files.iter().map(|file| (&name[..], file.as_path())).collect();
    output::check_distinct(&inputs, outputs)
}

fn input_of(scene: &Path) -> String {
    format!("an input of {}", scene.display())
}

/// Reads a scene, or makes the built-in scene. Prints each warning once.
pub(crate) fn scene(path: Option<&Path>, options: &ReadOptions) -> Result<Scene> {
    let Some(path) = path else { return Ok(canted_scene::builtin()) };
    let scene = if is_scene_file(path) {
        check_asset_options(path, options)?;
        scene_file(path)?.load()
    } else {
        canted_scene::read_with(path, options)
    };
    let mut scene = scene.map_err(with_remedy)?;
    report(&mut scene);
    Ok(scene)
}

/// The error with the options that read lines and points, where the file may have those and no faces; or that a folder is a store of tiles.
pub(crate) fn with_remedy(error: ReadError) -> anyhow::Error {
    let is_of_format =
        |path: &Path| ["obj", "ply", "gltf", "glb"].iter().any(|known| output::has_extension(path, known));
    match &error {
        ReadError::Empty { path, reason } if is_of_format(path) && reason.starts_with("no ") => {
            anyhow!("{error}; --line-radius and --point-radius show the lines and the points of a file")
        }
        ReadError::Io { path, .. } if canted_tiles::is_store(path) => {
            let path = path.display();
            anyhow!(
                "{path}: a store of tiles, which `canted cast` traces; this command reads the scenes that it was made of"
            )
        }
        _ => error.into(),
    }
}

/// As [`scene`], for a shutter that is open between two times in seconds.
pub(crate) fn scene_in_shutter(path: &Path, times: [f32; 2], options: &ReadOptions) -> Result<Scene> {
    let options = ReadOptions { time: Some(times[0]), ..options.clone() };
    let (mut animated, mut scene) = AnimatedScene::open(path, &options)?;
    let of_file = scene.warnings.clone();
    report(&mut scene);
    if !animated.is_animated() {
        output::warn(&format!("{}: the file has no animation; the picture shows its rest pose", path.display()));
    }
    animated.pose_shutter(times, &mut scene)?;
    scene.warnings.retain(|warning| !of_file.contains(warning));
    report(&mut scene);
    Ok(scene)
}

/// Rejects options for a scene file, which states them for each asset.
pub(crate) fn check_asset_options(scene_file: &Path, read: &ReadOptions) -> Result<()> {
    let ReadOptions { time, animation, variant, texture_paths, allow_parent, line_radius, point_radius } = read;
    let given = [
        ("time", "a glTF file", time.is_some()),
        ("animation", "a glTF file", animation.is_some()),
        ("variant", "a glTF file", variant.is_some()),
        ("texture_path", "the file of a model", !texture_paths.is_empty()),
        ("allow_parent", "the file of a model", *allow_parent),
        ("line_radius", "the file of a model", line_radius.is_some()),
        ("point_radius", "the file of a model", point_radius.is_some()),
    ];
    match given.into_iter().find(|&(.., is_given)| is_given) {
        None => Ok(()),
        Some((key, what, _)) => Err(anyhow!(
            "{}: {} requires {what}; in a scene file, set `{key}` in [[assets]]",
            scene_file.display(),
            options::flag(key)
        )),
    }
}

/// Prints what a reader repaired or skipped, and takes it from the scene.
pub(crate) fn report(scene: &mut Scene) {
    std::mem::take(&mut scene.warnings).iter().for_each(|warning| output::warn(warning));
    std::mem::take(&mut scene.notes).iter().for_each(|note| output::skipped(note));
}

/// Reads a scene file without the files that it refers to.
pub(crate) fn scene_file(path: &Path) -> Result<SceneFile> {
    Ok(SceneFile::read(path)?)
}

/// Whether a file name is that of a scene file.
pub(crate) fn is_scene_file(path: &Path) -> bool {
    output::has_extension(path, "toml")
}

/// The name of the scene in messages.
pub(crate) fn name(path: Option<&Path>) -> String {
    path.map_or_else(|| "built-in scene".to_owned(), |path| path.display().to_string())
}
