//! [`SceneFile`] to [`Scene`]: resolves paths, reads and instances the assets, edits materials.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use canted_obb::Affine;

use super::placement::after;
use super::read::unknown;
use super::tables::error_at;
use super::{Asset, AssetInstance, AssetSource, EnvironmentSource, MaterialEdits, Override, Placement, SceneFile};
use crate::read::quoted;
use crate::{
    Encoding, Environment, EnvironmentImage, Instance, Material, MaterialId, Mesh, MeshId, Part, ReadError,
    ReadOptions, Scene, Texture, TextureId, builtin, read_environment, read_with,
};

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
                (stem, AssetSource::File(relative(scene, folder(path))?))
            }
        };
        let (time, animation, variant, material) = (None, None, None, None);
        let (texture_path, allow_parent, line) = (Vec::new(), false, 0);
        let (line_radius, point_radius) = (None, None);
        let asset = Asset {
            name,
            source,
            time,
            animation,
            variant,
            material,
            texture_path,
            allow_parent,
            line_radius,
            point_radius,
            line,
        };
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

    /// Searches in these folders for the images of all assets, see [`ReadOptions::texture_paths`].
    ///
    /// # Errors
    /// A folder does not exist, or its path is not UTF-8.
    pub fn with_texture_paths(mut self, folders: &[PathBuf]) -> Result<Self, ReadError> {
        let own = folder(&self.path);
        let paths: Vec<String> = folders.iter().map(|path| relative(path, own)).collect::<Result<_, _>>()?;
        self.assets.iter_mut().for_each(|asset| asset.texture_path.clone_from(&paths));
        Ok(self)
    }

    /// Sets whether assets may refer to files outside their folders, see [`ReadOptions::allow_parent`].
    #[must_use]
    pub fn with_allow_parent(mut self, is_allowed: bool) -> Self {
        self.assets.iter_mut().for_each(|asset| asset.allow_parent = is_allowed);
        self
    }

    /// Gives all assets a radius of lines and of points, see [`ReadOptions::line_radius`].
    #[must_use]
    pub fn with_radii(mut self, [line_radius, point_radius]: [Option<f32>; 2]) -> Self {
        for asset in &mut self.assets {
            (asset.line_radius, asset.point_radius) = (line_radius, point_radius);
        }
        self
    }

    /// Sets the environment map to the file `image`, multiplied by `scale` and rotated by `turn_degrees`.
    ///
    /// # Errors
    /// `image` does not exist, or its path is not UTF-8.
    pub fn with_environment(mut self, image: &Path, scale: [f32; 3], turn_degrees: f32) -> Result<Self, ReadError> {
        let file = relative(image, folder(&self.path))?;
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
        for table in &self.curves {
            assembly.add_curves(table.mesh(), table.own_material(), table.material.as_ref(), table.line)?;
        }
        for table in &self.patches {
            assembly.add_curves(table.mesh(), table.own_material(), table.material.as_ref(), table.line)?;
        }
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
    fn error_of(&self, line: usize, key: &str, error: ReadError) -> ReadError {
        if line == 0 { error } else { error_at(&self.path, line, format!("{key}: {error}")) }
    }

    fn load_environment(&self, source: &EnvironmentSource, scene: &mut Scene) -> Result<Environment, ReadError> {
        match source {
            EnvironmentSource::Constant(radiance) => Ok(Environment::Constant(*radiance)),
            EnvironmentSource::Image { file, scale, turn_degrees, line } => {
                let image = self.regular(file).and_then(|path| read_environment(&path, &mut scene.warnings));
                let image = image.map_err(|error| self.error_of(*line, "'image' in [environment]", error))?;
                Ok(Environment::Image(EnvironmentImage { scale: *scale, turn_degrees: *turn_degrees, ..image }))
            }
        }
    }
}

impl Override {
    /// Whether the override applies to a material of an asset.
    fn applies_to(&self, asset: &str, material: &Material) -> bool {
        self.asset.as_ref().is_none_or(|name| name == asset) && self.material == material.name
    }
}

/// A scene under construction.
struct Assembly<'a> {
    file: &'a SceneFile,
    scene: Scene,
    /// Material range of each asset.
    asset_materials: Vec<Range<usize>>,
    /// Instances within each asset's own file, by asset name.
    instances: HashMap<&'a str, Vec<Instance>>,
    /// Mesh ranges whose material is replaced, with the name of the new material.
    material_overrides: Vec<(Range<usize>, &'a str)>,
    /// Textures that the scene file references.
    textures: HashMap<(String, Encoding), TextureId>,
    n_primitives: u32,
}

impl<'a> Assembly<'a> {
    fn new(file: &'a SceneFile) -> Self {
        Self {
            file,
            scene: Scene::default(),
            asset_materials: Vec::new(),
            instances: HashMap::new(),
            material_overrides: Vec::new(),
            textures: HashMap::new(),
            n_primitives: 0,
        }
    }

    /// Reads and adds an asset; an unused one is not read.
    fn add(&mut self, asset: &'a Asset, is_placed: bool) -> Result<(), ReadError> {
        let first_material = self.scene.materials.len();
        if is_placed {
            let given = self.file.given.iter().find(|(name, _)| *name == asset.name);
            let own = match (given, &asset.source) {
                (Some((_, given)), _) => Scene::clone(given),
                (None, AssetSource::Builtin) => builtin(),
                (None, AssetSource::File(file)) => {
                    let options = ReadOptions {
                        time: asset.time,
                        animation: asset.animation.clone(),
                        variant: asset.variant.clone(),
                        texture_paths: asset.texture_path.iter().map(|path| self.file.resolve(path)).collect(),
                        allow_parent: asset.allow_parent,
                        line_radius: asset.line_radius,
                        point_radius: asset.point_radius,
                    };
                    let own = self.file.regular(file).and_then(|path| read_with(&path, &options));
                    own.map_err(|error| self.file.error_of(asset.line, "'file' in [[assets]]", error))?
                }
            };
            self.append(asset, own)?;
        } else {
            self.scene.warnings.push(format!("skipping asset {}: no instance uses it", quoted(asset.name.as_bytes())));
        }
        self.asset_materials.push(first_material..self.scene.materials.len());
        Ok(())
    }

    fn append(&mut self, asset: &'a Asset, own: Scene) -> Result<(), ReadError> {
        let too_many =
            || error_at(&self.file.path, asset.line, "too many meshes, materials or triangles (limit: 2^32)");
        let shift = |n: usize| u32::try_from(n).map_err(|_| too_many());
        let first_mesh = self.scene.meshes.len();
        let (mesh_shift, texture_shift) = (shift(first_mesh)?, shift(self.scene.textures.len())?);
        let material_shift = shift(self.scene.materials.len())?;
        let mut ends = own.instances.iter().map(|instance| {
            let n_primitives = own.meshes[instance.mesh.0 as usize].n_primitives();
            u32::try_from(n_primitives).ok()?.checked_add(instance.first_primitive)
        });
        let n_primitives = ends.try_fold(0, |most: u32, n| Some(most.max(n?)));
        let all = n_primitives.and_then(|n| self.n_primitives.checked_add(n)).ok_or_else(too_many)?;

        let Scene {
            mut meshes,
            mut instances,
            mut materials,
            textures,
            lights,
            environment,
            // No reader sets them.
            ground: _,
            background: _,
            cameras,
            camera_names,
            warnings,
            notes,
            files,
        } = own;
        for instance in &mut instances {
            instance.mesh.0 += mesh_shift;
            instance.first_primitive += self.n_primitives;
        }
        self.n_primitives = all;
        for mesh in &mut meshes {
            mesh.parts.iter_mut().for_each(|part| part.material.0 += material_shift);
        }
        for reference in materials.iter_mut().flat_map(Material::textures_mut).flatten() {
            reference.texture.0 += texture_shift;
        }
        self.instances.insert(&asset.name, instances);
        self.scene.meshes.extend(meshes);
        if let Some(material) = &asset.material {
            self.material_overrides.push((first_mesh..self.scene.meshes.len(), material));
        } else {
            self.scene.materials.extend(materials);
            self.scene.textures.extend(textures);
        }
        self.scene.lights.extend(lights);
        self.scene.cameras.extend(cameras);
        self.scene.camera_names.extend(camera_names);
        self.scene.warnings.extend(warnings);
        self.scene.notes.extend(notes);
        self.scene.files.extend(files);
        self.scene.environment = self.scene.environment.take().or(environment);
        Ok(())
    }

    /// Adds an instance of an asset.
    fn add_instance(&mut self, instance: &AssetInstance) {
        let open = instance.open.affine();
        let close = instance.close.map(|close| close.affine());
        for own in self.instances.get(&instance.asset[..]).into_iter().flatten() {
            let moves = close.is_some() || own.world_from_object_close.is_some();
            let own_close = own.world_from_object_close.unwrap_or(own.world_from_object);
            self.scene.instances.push(Instance {
                world_from_object: after(&open, &own.world_from_object),
                world_from_object_close: moves.then(|| after(&close.unwrap_or(open), &own_close)),
                ..*own
            });
        }
    }

    /// Adds the curves or patches of a table as a mesh with one instance; `material_name` is that of a new one, in place of `plain`.
    fn add_curves(
        &mut self,
        own: Mesh,
        plain: Material,
        material_name: Option<&'a String>,
        line: usize,
    ) -> Result<(), ReadError> {
        let too_many = || error_at(&self.file.path, line, "too many curves and patches (limit: 2^32 segments)");
        let mesh = u32::try_from(self.scene.meshes.len()).map_err(|_| too_many())?;
        let material = u32::try_from(self.scene.materials.len()).map_err(|_| too_many())?;
        let n = u32::try_from(own.n_primitives()).ok().and_then(|n| self.n_primitives.checked_add(n));
        let next = n.ok_or_else(too_many)?;
        match material_name {
            Some(name) => self.material_overrides.push((self.scene.meshes.len()..self.scene.meshes.len() + 1, name)),
            None => self.scene.materials.push(plain),
        }
        self.scene.meshes.push(Mesh { parts: vec![Part { first_triangle: 0, material: MaterialId(material) }], ..own });
        self.scene.instances.push(Instance {
            mesh: MeshId(mesh),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: self.n_primitives,
        });
        self.n_primitives = next;
        Ok(())
    }

    /// Applies the overrides in order.
    fn change_materials(&mut self) -> Result<(), ReadError> {
        let file = self.file;
        let owners: Vec<(&str, usize)> = file
            .assets
            .iter()
            .zip(&self.asset_materials)
            .flat_map(|(asset, range)| range.clone().map(|material| (&asset.name[..], material)))
            .collect();
        for change in &file.overrides {
            let concerned: Vec<usize> = owners
                .iter()
                .filter(|&&(asset, material)| change.applies_to(asset, &self.scene.materials[material]))
                .map(|&(_, material)| material)
                .collect();
            if concerned.is_empty() {
                let of_asset = |asset: &str| change.asset.as_ref().is_none_or(|name| name == asset);
                let known = owners.iter().filter(|(asset, _)| of_asset(asset));
                let names = known.map(|&(_, material)| &self.scene.materials[material].name[..]);
                return Err(error_at(&file.path, change.line, unknown("material", &change.material, names)));
            }
            for material in concerned {
                self.edit(material, &change.edits, change.line)?;
            }
        }
        Ok(())
    }

    /// Adds the new materials and assigns them to the assets that use them.
    fn add_new_materials(&mut self) -> Result<(), ReadError> {
        let file = self.file;
        let first = self.scene.materials.len();
        for new in &file.materials {
            self.scene.materials.push(Material { name: new.name.clone(), ..Material::default() });
        }
        for (meshes, name) in std::mem::take(&mut self.material_overrides) {
            let position = file.materials.iter().position(|new| new.name == *name).map_or(first, |k| first + k);
            let material = MaterialId(position as u32);
            self.scene.meshes[meshes]
                .iter_mut()
                .for_each(|mesh| mesh.parts = vec![Part { first_triangle: 0, material }]);
        }
        for (k, new) in file.materials.iter().enumerate() {
            self.edit(first + k, &new.edits, new.line)?;
        }
        Ok(())
    }

    fn edit(&mut self, material: usize, edits: &MaterialEdits, line: usize) -> Result<(), ReadError> {
        let mut changed = self.scene.materials[material].clone();
        edits.apply(&mut changed, |file, encoding| self.texture(file, encoding, line))?;
        if edits.adds_texture() {
            let uses = |mesh: &&Mesh| mesh.parts.iter().any(|part| part.material.0 as usize == material);
            let mut meshes = self.scene.meshes.iter().filter(uses);
            // Curves have coordinates of their own, but no frame for the normals of a texture.
            let lacks = |mesh: &&Mesh| match mesh.curves {
                Some(_) => changed.normal_texture.is_some(),
                None => mesh.uvs.is_none(),
            };
            if let Some(mesh) = meshes.find(lacks) {
                let why = if mesh.has_patches() {
                    "is made of patches, which have no normal maps"
                } else if mesh.curves.is_some() {
                    "is made of curves, which have no normal maps"
                } else {
                    "has no texture coordinates"
                };
                let [material, mesh] = [&changed.name, &mesh.name].map(|name| quoted(name.as_bytes()));
                let message = format!("cannot texture material {material}: mesh {mesh} {why}");
                return Err(error_at(&self.file.path, line, message));
            }
        }
        self.scene.materials[material] = changed;
        Ok(())
    }

    /// The texture of an image file; each file is read once per encoding.
    fn texture(&mut self, file: &str, encoding: Encoding, line: usize) -> Result<TextureId, ReadError> {
        let key = (file.to_owned(), encoding);
        if let Some(&known) = self.textures.get(&key) {
            return Ok(known);
        }
        let error_for = |reason: String| {
            error_at(&self.file.path, line, format!("cannot load texture {}: {reason}", quoted(file.as_bytes())))
        };
        let path = self.file.regular(file).map_err(|error| error_for(error.to_string()))?;
        let bytes = fs::read(path).map_err(|error| error_for(error.to_string()))?;
        let texture = crate::read::decode(file, &bytes).map_err(&error_for)?;
        let id = u32::try_from(self.scene.textures.len())
            .map_err(|_| error_for("too many textures (limit: 2^32)".into()))?;
        self.scene.textures.push(Texture { encoding, ..texture });
        self.textures.insert(key, TextureId(id));
        Ok(TextureId(id))
    }
}

impl SceneFile {
    /// Resolves a path in this file.
    fn resolve(&self, file: &str) -> PathBuf {
        folder(&self.path).join(file)
    }

    /// As [`SceneFile::resolve`], for a file to read: a pipe or a device may have no end.
    fn regular(&self, file: &str) -> Result<PathBuf, ReadError> {
        let path = self.resolve(file);
        let metadata = fs::metadata(&path).map_err(ReadError::io(&path))?;
        if !metadata.is_file() {
            return Err(ReadError::io(&path)(io::Error::other("not a regular file")));
        }
        Ok(path)
    }

    /// Moves the scene file to `path`, rewriting its relative paths to refer to the same files.
    ///
    /// # Errors
    /// A referenced file does not exist, or its path is not UTF-8.
    pub fn moved_to(mut self, path: &Path) -> Result<Self, ReadError> {
        let from = folder(&self.path).to_owned();
        let to = folder(path);
        for file in self.files_mut() {
            *file = relative(&from.join(&file), to)?;
        }
        path.clone_into(&mut self.path);
        Ok(self)
    }

    /// Resolved paths of all files that this one references.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        self.clone().files_mut().map(|file| self.resolve(file)).collect()
    }

    /// All paths of files and folders in this file.
    fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let assets = self.assets.iter_mut().flat_map(|asset| {
            let file = match &mut asset.source {
                AssetSource::File(file) => Some(file),
                AssetSource::Builtin => None,
            };
            file.into_iter().chain(&mut asset.texture_path)
        });
        let environment = self.environment.iter_mut().filter_map(|environment| match environment {
            EnvironmentSource::Image { file, .. } => Some(file),
            EnvironmentSource::Constant(_) => None,
        });
        let materials = self.materials.iter_mut().flat_map(|material| material.edits.files_mut());
        let overrides = self.overrides.iter_mut().flat_map(|change| change.edits.files_mut());
        assets.chain(environment).chain(materials).chain(overrides)
    }
}

/// The folder of a file; empty for the current folder.
fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// `.` for the empty path.
fn or_current(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

/// The path from `folder` to `file`, separated by `/`; `.` for the folder itself. Both must exist.
fn relative(file: &Path, folder: &Path) -> Result<String, ReadError> {
    let real = |path: &Path| fs::canonicalize(path).map_err(|source| ReadError::Io { path: path.to_owned(), source });
    let not_utf8 = || {
        let source = io::Error::new(io::ErrorKind::InvalidInput, "the path is not UTF-8");
        ReadError::Io { path: file.to_owned(), source }
    };
    // Does not follow a link in the last component: files it references lie next to the link.
    let target = match (real(file)?, file.file_name()) {
        (_, Some(name)) => real(or_current(self::folder(file)))?.join(name),
        (target, None) => target,
    };
    let folder = real(or_current(folder))?;
    let n_common = target.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if target.components().take(n_common).all(|component| matches!(component, Component::Prefix(_))) {
        // Another drive: no relative path exists.
        return target.to_str().map(str::to_owned).ok_or_else(not_utf8);
    }
    let up = folder.components().skip(n_common).map(|_| Some(".."));
    let down = target.components().skip(n_common).map(|component| component.as_os_str().to_str());
    let names: Option<Vec<&str>> = up.chain(down).collect();
    let path = names.ok_or_else(not_utf8)?.join("/");
    Ok(if path.is_empty() { ".".to_owned() } else { path })
}
