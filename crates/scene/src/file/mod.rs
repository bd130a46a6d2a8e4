//! Scene files: assets, how they are placed, looked at, lit and coloured, and how the picture is made. TOML.
//!
//! ```text
//! text -> table -> {camera, light, environment, material, placement} -> SceneFile -> load -> Scene
//! SceneFile -> write -> text
//! ```

mod assemble;
mod camera;
mod closest_match;
mod direction;
mod environment;
mod light;
mod load;
mod material;
mod page;
mod paths;
mod placement;
mod read;
mod table;
#[cfg(test)]
mod tests;
mod write;

use crate::{Camera, Light};

pub use closest_match::closest_match;
pub use environment::EnvironmentSource;
pub use material::MaterialEdits;
pub use placement::Placement;

/// A scene as people write it down: what is drawn, from where, in which light, and how.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scene.toml");
/// # std::fs::write(folder.path().join("model.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3")?;
/// # std::fs::write(&path, r#"
/// [[assets]]
/// name = "triangle"
/// file = "model.obj"
///
/// [[instances]]
/// asset = "triangle"
///
/// [[instances]]
/// asset = "triangle"
/// translation = [2, 0, 0]
/// # "#)?;
/// use canted_scene::SceneFile;
///
/// let scene = SceneFile::read(&path)?.load()?;
/// assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Paths in it are relative to its own folder and may lead out of it: whoever writes a scene file names the files meant.
/// The files that an asset names itself stay in the asset's folder.
///
/// Camera, lights and environment replace those of all assets. Where one of them is not said, that of the assets counts, as
/// their own files have it: instances do not move it.
#[derive(Clone, Debug, Default)]
pub struct SceneFile {
    /// Where it stands or will stand; paths are relative to its folder.
    path: std::path::PathBuf,
    /// What is drawn.
    pub assets: Vec<Asset>,
    /// Where; `None` places each asset once as its own file has it.
    pub instances: Option<Vec<AssetInstance>>,
    /// From where; `None` leaves the choice to the assets.
    pub camera: Option<Camera>,
    /// Lights that are no triangles; `None` keeps those of the assets, an empty list has none.
    pub lights: Option<Vec<Light>>,
    /// Light from outside; `None` keeps that of the assets.
    pub environment: Option<EnvironmentSource>,
    /// Materials that no asset brings.
    pub materials: Vec<NewMaterial>,
    /// Changes of materials that assets bring.
    pub overrides: Vec<Override>,
    /// How the picture is made, in the words of whoever makes it.
    pub settings: Vec<Setting>,
}

/// Something to place.
#[derive(Clone, Debug, PartialEq)]
pub struct Asset {
    /// By which instances call it.
    pub name: String,
    /// What it is.
    pub source: AssetSource,
    /// Seconds into its animation, as [`crate::ReadOptions::time`].
    pub time: Option<f32>,
    /// Name of a new material that replaces all of its own.
    pub material: Option<String>,
    /// Line of the file, 0 where it was not read.
    pub line: usize,
}

/// What an asset is.
#[derive(Clone, Debug, PartialEq)]
pub enum AssetSource {
    /// A file of a format that [`crate::read`] reads.
    File(String),
    /// The scene that comes with this crate.
    Builtin,
}

/// A placed asset.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetInstance {
    /// Its name.
    pub asset: String,
    /// Where it stands; of a moving one, as the shutter opens.
    pub open: Placement,
    /// Of a moving one, where it is as the shutter closes.
    pub close: Option<Placement>,
    /// Line of the file, 0 where it was not read.
    pub line: usize,
}

/// A material that no asset brings.
#[derive(Clone, Debug, PartialEq)]
pub struct NewMaterial {
    /// By which assets call it.
    pub name: String,
    /// In what it differs from [`crate::Material::default`].
    pub edits: MaterialEdits,
    /// Line of the file, 0 where it was not read.
    pub line: usize,
}

/// Changes of the materials of one name.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// The asset; `None` for all that have a material of the name.
    pub asset: Option<String>,
    /// Name of the materials.
    pub material: String,
    /// In what they change.
    pub edits: MaterialEdits,
    /// Line of the file, 0 where it was not read.
    pub line: usize,
}

/// A word to whoever makes the picture; what it means is not this crate's to say.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// What is set.
    pub key: String,
    /// To what; lists are joined by commas. `None` leaves it unsaid but for the comment.
    pub value: Option<String>,
    /// What it means, for the file's reader; not read.
    pub comment: String,
    /// Line of the file, 0 where it was not read.
    pub line: usize,
}
