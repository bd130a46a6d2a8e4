//! Scene files in TOML: assets, instances, camera, lights, environment, materials, render settings.
//!
//! ```text
//! text -> tables {curves, patches, light, material, placement} -> read -> SceneFile -> load -> Scene
//! SceneFile -> write -> text
//! ```

mod curves;
mod light;
mod load;
mod material;
mod patches;
mod placement;
mod read;
mod tables;
mod write;
mod writer;

use std::path::Path;
use std::sync::Arc;

use crate::{Camera, Light, Scene};

pub use curves::{CurveBasis, CurveTable};
pub use light::EnvironmentSource;
pub use material::MaterialEdits;
pub use patches::PatchTable;
pub use placement::Placement;
pub use tables::{closest_match, suggestion};

/// A scene file: assets, instances, camera, lights, environment, materials and render settings.
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
/// Paths are relative to the folder of the scene file and may lead out of it, but not to pipes and devices. Files that an asset
/// references must lie in the asset's folder, unless its table permits more.
///
/// Camera, lights and environment replace those of all assets. If one is absent, those of the assets are used, untransformed
/// by instances.
#[derive(Clone, Debug, Default)]
pub struct SceneFile {
    /// Path of the scene file; paths in it are relative to its folder.
    path: std::path::PathBuf,
    /// Contents of assets that are not read, by name.
    given: Vec<(String, Arc<Scene>)>,
    /// The assets.
    pub assets: Vec<Asset>,
    /// Instances of assets; `None`: one per asset, untransformed.
    pub instances: Option<Vec<AssetInstance>>,
    /// Curves, each of them an instance after those of the assets.
    pub curves: Vec<CurveTable>,
    /// Patches, each table an instance after those of the curves.
    pub patches: Vec<PatchTable>,
    /// The camera; `None`: that of the assets.
    pub camera: Option<Camera>,
    /// Lights; `None`: those of the assets; empty: none.
    pub lights: Option<Vec<Light>>,
    /// Environment light; `None`: that of the assets.
    pub environment: Option<EnvironmentSource>,
    /// New materials.
    pub materials: Vec<NewMaterial>,
    /// Changes to materials of assets.
    pub overrides: Vec<Override>,
    /// Render settings; this crate does not interpret them.
    pub settings: Vec<Setting>,
}

impl SceneFile {
    /// The path that it was read from, or that it is to have.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the asset of this name its content, instead of what its source says.
    ///
    /// The scene must keep the promises of [`Scene`]: indices in range, positions of triangles finite.
    #[must_use]
    pub fn with_asset(mut self, name: &str, content: Scene) -> Self {
        self.given.retain(|(known, _)| known != name);
        self.given.push((name.to_owned(), Arc::new(content)));
        self
    }
}

/// A model to instance.
#[derive(Clone, Debug, PartialEq)]
pub struct Asset {
    /// Name used by instances.
    pub name: String,
    /// File or built-in scene.
    pub source: AssetSource,
    /// Animation time, see [`crate::ReadOptions::time`].
    pub time: Option<f32>,
    /// Name or number of the animation, see [`crate::ReadOptions::animation`].
    pub animation: Option<String>,
    /// Name or number of the material variant, see [`crate::ReadOptions::variant`].
    pub variant: Option<String>,
    /// Name of a new material that replaces all materials of the asset.
    pub material: Option<String>,
    /// Folders of images, see [`crate::ReadOptions::texture_paths`].
    pub texture_path: Vec<String>,
    /// Whether the asset may refer to files outside its folder, see [`crate::ReadOptions::allow_parent`].
    pub allow_parent: bool,
    /// Radius of lines, see [`crate::ReadOptions::line_radius`].
    pub line_radius: Option<f32>,
    /// Radius of points, see [`crate::ReadOptions::point_radius`].
    pub point_radius: Option<f32>,
    /// Line in the file; 0 if not read from one.
    pub line: usize,
}

/// Source of an asset.
#[derive(Clone, Debug, PartialEq)]
pub enum AssetSource {
    /// A file supported by [`crate::read`].
    File(String),
    /// The built-in scene, [`crate::builtin`].
    Builtin,
}

/// An instance of an asset.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetInstance {
    /// Name of the asset.
    pub asset: String,
    /// Transform; for a moving instance, the one at shutter open.
    pub open: Placement,
    /// Transform at shutter close, for a moving instance.
    pub close: Option<Placement>,
    /// Line in the file; 0 if not read from one.
    pub line: usize,
}

/// A new material.
#[derive(Clone, Debug, PartialEq)]
pub struct NewMaterial {
    /// Name used by assets.
    pub name: String,
    /// Changes relative to [`crate::Material::default`].
    pub edits: MaterialEdits,
    /// Line in the file; 0 if not read from one.
    pub line: usize,
}

/// Changes to all materials with a given name.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// The asset; `None` for all assets.
    pub asset: Option<String>,
    /// Name of the materials.
    pub material: String,
    /// The changes.
    pub edits: MaterialEdits,
    /// Line in the file; 0 if not read from one.
    pub line: usize,
}

/// A render setting; its meaning is defined by the renderer.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the setting.
    pub key: String,
    /// Value; arrays are joined by commas. `None` writes only the comment.
    pub value: Option<String>,
    /// Explanation, written to the file but not read.
    pub comment: String,
    /// Line in the file; 0 if not read from one.
    pub line: usize,
}
