//! From [`SceneFile`] to [`Scene`]: assets are read and placed, materials changed.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::assemble::Assembled;
use super::table::error_at;
use super::{Asset, AssetInstance, AssetSource, EnvironmentSource, MaterialEdits, Override, Placement, SceneFile};
use crate::{Environment, EnvironmentImage, Material, ReadError, Scene, read_environment};

impl SceneFile {
    /// A file to stand at `path`, whose only asset is the scene of another file, or the built-in one.
    ///
    /// # Errors
    /// The other file is not there, or its path is not UTF-8.
    pub fn for_scene(scene: Option<&Path>, path: &Path) -> Result<Self, ReadError> {
        let (name, source) = match scene {
            None => ("builtin".to_owned(), AssetSource::Builtin),
            Some(scene) => {
                let stem = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                (stem, AssetSource::File(super::paths::relative(scene, super::paths::folder(path))?))
            }
        };
        let asset = Asset { name, source, time: None, material: None, line: 0 };
        Ok(Self { path: path.to_owned(), assets: vec![asset], ..Self::default() })
    }

    /// The same scene with all assets posed at a time, in seconds into their animations.
    #[must_use]
    pub fn with_time(mut self, time: f32) -> Self {
        self.assets.iter_mut().for_each(|asset| asset.time = Some(time));
        self
    }

    /// The same scene under the picture of an environment in another file, times `scale`, turned by `turn_degrees`.
    ///
    /// # Errors
    /// The other file is not there, or its path is not UTF-8.
    pub fn with_environment(mut self, image: &Path, scale: [f32; 3], turn_degrees: f32) -> Result<Self, ReadError> {
        let file = super::paths::relative(image, super::paths::folder(&self.path))?;
        self.environment = Some(EnvironmentSource::Image { file, scale, turn_degrees, line: 0 });
        Ok(self)
    }

    /// Reads the files named and puts the scene together.
    ///
    /// # Errors
    /// [`ReadError`] of this file, with its line, and behind it that of the file named there, where it is at fault.
    pub fn load(&self) -> Result<Scene, ReadError> {
        self.assemble().map(|assembled| assembled.scene)
    }

    /// Puts the scene together, and says all of it that this file could have said: where each asset stands, and every
    /// number of every material that has a name of its own; what was said of a name that several have stays as it was said.
    ///
    /// # Errors
    /// As [`SceneFile::load`].
    pub fn load_explicit(&self) -> Result<(Scene, Self), ReadError> {
        let Assembled { scene, of_assets, .. } = self.assemble()?;
        let mut file = self.clone();
        file.instances = Some(self.placed().into_owned());
        file.camera = self.camera.or_else(|| scene.cameras.first().copied());
        file.lights = Some(scene.lights.clone());
        let new = scene.materials.len() - file.materials.len();
        for (material, full) in file.materials.iter_mut().zip(&scene.materials[new..]) {
            material.edits = material.edits.spelled_out(full);
        }
        file.overrides = Vec::new();
        for (asset, range) in self.assets.iter().zip(of_assets) {
            file.overrides.extend(self.overrides_of(asset, &scene.materials[range]));
        }
        Ok((scene, file))
    }

    /// Full changes of the materials that are the only ones of their name in an asset, and of others what was said of their name.
    fn overrides_of(&self, asset: &Asset, materials: &[Material]) -> Vec<Override> {
        let mut n_of_name: HashMap<&str, usize> = HashMap::new();
        materials.iter().for_each(|material| *n_of_name.entry(&material.name).or_default() += 1);
        let mut is_told = HashSet::new();
        let told = materials.iter().filter(|material| is_told.insert(&material.name[..]));
        let change = told.filter_map(|material| {
            // What was said of textures stays said; the last word counts.
            let said = self.overrides.iter().rev().filter(|change| change.concerns(&asset.name, material));
            let edits = said.map(|change| &change.edits).fold(MaterialEdits::default(), |all, edits| all.or(edits));
            let is_alone = n_of_name[&material.name[..]] == 1;
            let edits = if is_alone { edits.spelled_out(material) } else { edits };
            (edits != MaterialEdits::default()).then(|| Override {
                asset: Some(asset.name.clone()),
                material: material.name.clone(),
                edits,
                line: 0,
            })
        });
        change.collect()
    }

    /// The instances, one for each asset where nothing is said.
    fn placed(&self) -> Cow<'_, [AssetInstance]> {
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

    fn assemble(&self) -> Result<Assembled<'_>, ReadError> {
        let mut assembled = Assembled::new(self);
        let placed = self.placed();
        let names: HashSet<&str> = placed.iter().map(|instance| &instance.asset[..]).collect();
        for asset in &self.assets {
            assembled.add(asset, names.contains(&asset.name[..]))?;
        }
        placed.iter().for_each(|instance| assembled.place(instance));
        assembled.change_materials()?;
        assembled.add_new_materials()?;
        let scene = &mut assembled.scene;
        if let Some(camera) = self.camera {
            scene.cameras = vec![camera];
        }
        if let Some(lights) = &self.lights {
            scene.lights.clone_from(lights);
        }
        if let Some(environment) = &self.environment {
            scene.environment = Some(self.load_environment(environment, scene)?);
        }
        if scene.instances.is_empty() {
            return Err(ReadError::empty(&self.path, "no asset is placed"));
        }
        Ok(assembled)
    }

    /// The error of a file that this one names in a line, by a key. Where this one was not read nothing is to be mended in it.
    pub(super) fn error_of(&self, line: usize, key: &str, error: ReadError) -> ReadError {
        if line == 0 { error } else { error_at(&self.path, line, format!("{key}: {error}")) }
    }

    fn load_environment(&self, source: &EnvironmentSource, scene: &mut Scene) -> Result<Environment, ReadError> {
        match source {
            EnvironmentSource::Constant(radiance) => Ok(Environment::Constant(*radiance)),
            EnvironmentSource::Image { file, scale, turn_degrees, line } => {
                let image = read_environment(&self.resolve(file), &mut scene.warnings)
                    .map_err(|error| self.error_of(*line, "`image` of [environment]", error))?;
                Ok(Environment::Image(EnvironmentImage { scale: *scale, turn_degrees: *turn_degrees, ..image }))
            }
        }
    }
}

impl Override {
    pub(super) fn concerns(&self, asset: &str, material: &Material) -> bool {
        self.asset.as_ref().is_none_or(|name| name == asset) && self.material == material.name
    }
}
