//! Merges assets into one scene: shifts indices, composes transforms, edits materials.

use std::collections::HashMap;
use std::fs;
use std::ops::Range;

use super::placement::after;
use super::read::unknown;
use super::table::error_at;
use super::{Asset, AssetInstance, AssetSource, MaterialEdits, SceneFile};
use crate::read::quoted;
use crate::{
    Encoding, Instance, Material, MaterialId, Part, ReadError, ReadOptions, Scene, Texture, TextureId, builtin,
    read_with,
};

/// A scene under construction.
pub(super) struct Assembly<'a> {
    file: &'a SceneFile,
    pub(super) scene: Scene,
    /// Material range of each asset.
    pub(super) asset_materials: Vec<Range<usize>>,
    /// Instances within each asset's own file, by asset name.
    instances: HashMap<&'a str, Vec<Instance>>,
    /// Mesh ranges whose material is replaced, with the name of the new material.
    material_overrides: Vec<(Range<usize>, &'a str)>,
    /// Textures that the scene file references.
    textures: HashMap<(String, Encoding), TextureId>,
    n_primitives: u32,
}

impl<'a> Assembly<'a> {
    pub(super) fn new(file: &'a SceneFile) -> Self {
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
    pub(super) fn add(&mut self, asset: &'a Asset, is_placed: bool) -> Result<(), ReadError> {
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
                    };
                    read_with(&self.file.resolve(file), &options)
                        .map_err(|error| self.file.error_of(asset.line, "'file' in [[assets]]", error))?
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
            let n_triangles = own.meshes[instance.mesh.0 as usize].triangles.len();
            u32::try_from(n_triangles).ok()?.checked_add(instance.first_primitive)
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
            cameras,
            camera_names,
            warnings,
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
        self.scene.files.extend(files);
        self.scene.environment = self.scene.environment.take().or(environment);
        Ok(())
    }

    /// Adds an instance of an asset.
    pub(super) fn add_instance(&mut self, instance: &AssetInstance) {
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

    /// Applies the overrides in order.
    pub(super) fn change_materials(&mut self) -> Result<(), ReadError> {
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
    pub(super) fn add_new_materials(&mut self) -> Result<(), ReadError> {
        let file = self.file;
        let first = self.scene.materials.len();
        for new in &file.materials {
            self.scene.materials.push(Material { name: new.name.clone(), ..Material::default() });
        }
        for (meshes, name) in std::mem::take(&mut self.material_overrides) {
            let position = file.materials.iter().position(|new| new.name == *name).map_or(first, |k| first + k);
            #[expect(clippy::cast_possible_truncation, reason = "few materials are written by hand")]
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
            let lacks = |mesh: &&crate::Mesh| {
                mesh.uvs.is_none() && mesh.parts.iter().any(|part| part.material.0 as usize == material)
            };
            if let Some(mesh) = self.scene.meshes.iter().find(lacks) {
                let [material, mesh] = [&changed.name, &mesh.name].map(|name| quoted(name.as_bytes()));
                let message = format!("cannot texture material {material}: mesh {mesh} has no texture coordinates");
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
        let bytes = fs::read(self.file.resolve(file)).map_err(|error| error_for(error.to_string()))?;
        let texture = crate::read::decode(file, &bytes).map_err(&error_for)?;
        let id = u32::try_from(self.scene.textures.len())
            .map_err(|_| error_for("too many textures (limit: 2^32)".into()))?;
        self.scene.textures.push(Texture { encoding, ..texture });
        self.textures.insert(key, TextureId(id));
        Ok(TextureId(id))
    }
}
