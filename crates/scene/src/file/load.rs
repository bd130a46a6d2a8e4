//! [`SceneFile`] to [`Scene`]: reads and instances the assets, edits materials.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::assembly::Assembly;
use super::table::error_at;
use super::{Asset, AssetInstance, AssetSource, EnvironmentSource, MaterialEdits, Override, Placement, SceneFile};
use crate::{Environment, EnvironmentImage, Material, ReadError, Scene, read_environment};

impl SceneFile {
    /// A scene file at `path` with one asset: the file `scene`, or the built-in scene for `None`.
    ///
    /// # Errors
    /// `scene` does not exist, or its path is not UTF-8.
    pub fn for_scene(scene: Option<&Path>, path: &Path) -> Result<Self, ReadError> {
        let (name, source) = match scene {
            None => ("builtin".to_owned(), AssetSource::Builtin),
            Some(scene) => {
                let stem = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                (stem, AssetSource::File(super::paths::relative(scene, super::paths::folder(path))?))
            }
        };
        let asset = Asset { name, source, time: None, animation: None, variant: None, material: None, line: 0 };
        Ok(Self { path: path.to_owned(), assets: vec![asset], ..Self::default() })
    }

    /// Poses all assets at a time in seconds of their animations.
    #[must_use]
    pub fn with_time(mut self, time: f32) -> Self {
        self.assets.iter_mut().for_each(|asset| asset.time = Some(time));
        self
    }

    /// Poses all assets by the animation of this name or number.
    #[must_use]
    pub fn with_animation(mut self, animation: &str) -> Self {
        self.assets.iter_mut().for_each(|asset| asset.animation = Some(animation.to_owned()));
        self
    }

    /// Gives all assets the material variant of this name or number.
    #[must_use]
    pub fn with_variant(mut self, variant: &str) -> Self {
        self.assets.iter_mut().for_each(|asset| asset.variant = Some(variant.to_owned()));
        self
    }

    /// Sets the environment map to the file `image`, multiplied by `scale` and rotated by `turn_degrees`.
    ///
    /// # Errors
    /// `image` does not exist, or its path is not UTF-8.
    pub fn with_environment(mut self, image: &Path, scale: [f32; 3], turn_degrees: f32) -> Result<Self, ReadError> {
        let file = super::paths::relative(image, super::paths::folder(&self.path))?;
        self.environment = Some(EnvironmentSource::Image { file, scale, turn_degrees, line: 0 });
        Ok(self)
    }

    /// Reads the referenced files and assembles the scene.
    ///
    /// # Errors
    /// [`ReadError`] with this file and its line, followed by the error of the referenced file.
    pub fn load(&self) -> Result<Scene, ReadError> {
        self.assemble().map(|assembly| assembly.scene)
    }

    /// As [`SceneFile::load`], with a copy of this file in which every default is written out: instances, camera, lights
    /// and all fields of materials. Materials that share their name within an asset keep only the fields this file sets.
    ///
    /// # Errors
    /// As [`SceneFile::load`].
    pub fn load_explicit(&self) -> Result<(Scene, Self), ReadError> {
        let Assembly { scene, asset_materials, .. } = self.assemble()?;
        let mut file = self.clone();
        file.instances = Some(self.all_instances().into_owned());
        file.camera = self.camera.or_else(|| scene.cameras.first().copied());
        file.lights = Some(scene.lights.clone());
        let new = scene.materials.len() - file.materials.len();
        for (material, full) in file.materials.iter_mut().zip(&scene.materials[new..]) {
            material.edits = material.edits.explicit(full);
        }
        file.overrides = Vec::new();
        for (asset, range) in self.assets.iter().zip(asset_materials) {
            file.overrides.extend(self.overrides_of(asset, &scene.materials[range]));
        }
        Ok((scene, file))
    }

    /// Overrides for the materials of an asset: all fields where the name is unique, else those that this file sets.
    fn overrides_of(&self, asset: &Asset, materials: &[Material]) -> Vec<Override> {
        let mut n_of_name: HashMap<&str, usize> = HashMap::new();
        materials.iter().for_each(|material| *n_of_name.entry(&material.name).or_default() += 1);
        let mut is_new = HashSet::new();
        let distinct = materials.iter().filter(|material| is_new.insert(&material.name[..]));
        let overrides = distinct.filter_map(|material| {
            // Later overrides win; texture fields only come from the file.
            let from_file = self.overrides.iter().rev().filter(|change| change.applies_to(&asset.name, material));
            let edits =
                from_file.map(|change| &change.edits).fold(MaterialEdits::default(), |all, edits| all.or(edits));
            let is_unique = n_of_name[&material.name[..]] == 1;
            let edits = if is_unique { edits.explicit(material) } else { edits };
            (edits != MaterialEdits::default()).then(|| Override {
                asset: Some(asset.name.clone()),
                material: material.name.clone(),
                edits,
                line: 0,
            })
        });
        overrides.collect()
    }

    /// The instances; by default one per asset.
    fn all_instances(&self) -> Cow<'_, [AssetInstance]> {
        let once = |asset: &Asset| AssetInstance {
            asset: asset.name.clone(),
            open: Placement::IDENTITY,
            close: None,
            line: asset.line,
        };
        match &self.instances {
            Some(instances) => instances.into(),
            None => self.assets.iter().map(once).collect(),
        }
    }

    fn assemble(&self) -> Result<Assembly<'_>, ReadError> {
        let mut assembly = Assembly::new(self);
        let placed = self.all_instances();
        let names: HashSet<&str> = placed.iter().map(|instance| &instance.asset[..]).collect();
        for asset in &self.assets {
            assembly.add(asset, names.contains(&asset.name[..]))?;
        }
        placed.iter().for_each(|instance| assembly.add_instance(instance));
        assembly.change_materials()?;
        assembly.add_new_materials()?;
        let scene = &mut assembly.scene;
        if let Some(camera) = self.camera {
            scene.cameras = vec![camera];
            scene.camera_names = vec![String::new()];
        }
        if let Some(lights) = &self.lights {
            scene.lights.clone_from(lights);
        }
        if let Some(environment) = &self.environment {
            scene.environment = Some(self.load_environment(environment, scene)?);
        }
        if scene.instances.is_empty() {
            return Err(ReadError::empty(&self.path, "no instances"));
        }
        Ok(assembly)
    }

    /// The error of a file that this one references by a key. Without a line this file was not read, so it is not mentioned.
    pub(super) fn error_of(&self, line: usize, key: &str, error: ReadError) -> ReadError {
        if line == 0 { error } else { error_at(&self.path, line, format!("{key}: {error}")) }
    }

    fn load_environment(&self, source: &EnvironmentSource, scene: &mut Scene) -> Result<Environment, ReadError> {
        match source {
            EnvironmentSource::Constant(radiance) => Ok(Environment::Constant(*radiance)),
            EnvironmentSource::Image { file, scale, turn_degrees, line } => {
                let image = read_environment(&self.resolve(file), &mut scene.warnings)
                    .map_err(|error| self.error_of(*line, "'image' in [environment]", error))?;
                Ok(Environment::Image(EnvironmentImage { scale: *scale, turn_degrees: *turn_degrees, ..image }))
            }
        }
    }
}

impl Override {
    /// Whether the override applies to a material of an asset.
    pub(super) fn applies_to(&self, asset: &str, material: &Material) -> bool {
        self.asset.as_ref().is_none_or(|name| name == asset) && self.material == material.name
    }
}
