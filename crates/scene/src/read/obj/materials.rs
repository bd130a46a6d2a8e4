//! The materials that faces use: recipes looked up in the libraries, textures decoded in parallel.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::read::folder::Folder;
use crate::read::{ReadError, image, mtl, text};
use crate::{AlphaMode, Material, Scene, Texture, TextureId, TextureRef};

/// What a texture is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Role {
    BaseColor,
    Mask,
}

/// A texture and the first material that asks for it.
struct Request {
    path: PathBuf,
    role: Role,
    /// For messages.
    name: String,
    material: usize,
}

/// Fills the scene's materials, one for each name in the same order, and their textures.
///
/// A library, material or texture that cannot be had becomes a warning and a plain surface.
pub(super) fn materials(
    path: &Path,
    libraries: &[&[u8]],
    names: &[Option<&[u8]>],
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let folder = Folder::of(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    let files = library_files(&folder, libraries, &mut scene.warnings);
    let mut recipes = HashMap::new();
    for (name, bytes) in &files {
        recipes.extend(mtl::recipes(name, bytes, &mut scene.warnings));
    }

    let mut requests = Requests { folder: &folder, list: Vec::new(), ids: HashMap::new() };
    let mut wanted = Vec::new();
    for (k, &name) in names.iter().enumerate() {
        let recipe = name.and_then(|name| recipes.get(name));
        if let (Some(name), None) = (name, recipe) {
            scene.warnings.push(format!("material {} is in no library; it is plain grey", text::quoted(name)));
        }
        let (material, maps) = material(name, recipe, &mut scene.warnings);
        scene.materials.push(material);
        for (map, role) in maps {
            match requests.add(&map, role, k) {
                Ok(request) => wanted.push((k, role, request)),
                Err(refusal) => scene.warnings.push(texture_warning(&scene.materials[k], &map, &refusal)),
            }
        }
    }

    let textures = load(&requests.list, scene);
    for (k, role, request) in wanted {
        let material = &mut scene.materials[k];
        match role {
            Role::BaseColor => material.base_color_texture = textures[request].map(TextureRef::plain),
            Role::Mask => {
                material.alpha_texture = textures[request].map(TextureRef::plain);
                material.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
            }
        }
    }
    Ok(())
}

/// Names and bytes of the files of all `mtllib` statements, each once: one name with blanks, else names between blanks.
fn library_files(folder: &Folder, statements: &[&[u8]], warnings: &mut Vec<String>) -> Vec<(String, Vec<u8>)> {
    let (mut known, mut files) = (HashSet::new(), Vec::new());
    for whole in statements.iter().map(|statement| String::from_utf8_lossy(statement)) {
        let names = match folder.resolve(&whole) {
            Ok(_) => vec![&whole[..]],
            Err(_) => whole.split_ascii_whitespace().collect(),
        };
        for name in names {
            // A file may be named thousands of times, so it is known by its path, and one that is absent by its name.
            let path = folder.resolve(name).unwrap_or_else(|_| PathBuf::from(name));
            if !known.insert(path) {
                continue;
            }
            match folder.read(name) {
                Ok(bytes) => files.push((name.to_owned(), bytes)),
                Err(refusal) => warnings.push(format!("material library {}: {refusal}", text::quoted(name.as_bytes()))),
            }
        }
    }
    files
}

/// The material without its textures, and the files that it wants.
fn material(
    name: Option<&[u8]>,
    recipe: Option<&mtl::Recipe>,
    warnings: &mut Vec<String>,
) -> (Material, Vec<(String, Role)>) {
    let name = String::from_utf8_lossy(name.unwrap_or_default()).into_owned();
    let plain = Material { name, ..Material::default() };
    let Some(recipe) = recipe else { return (plain, Vec::new()) };
    if recipe.is_translucent && recipe.mask.is_none() {
        warnings.push(format!("material {}: d or Tr is ignored; it is opaque", text::quoted(plain.name.as_bytes())));
    }
    let uncoloured = if recipe.base_color_map.is_some() { [1.0; 3] } else { plain.base_color };
    let material = Material { base_color: recipe.base_color.unwrap_or(uncoloured), emission: recipe.emission, ..plain };
    let maps = [(&recipe.base_color_map, Role::BaseColor), (&recipe.mask, Role::Mask)];
    (material, maps.into_iter().filter_map(|(map, role)| Some((map.clone()?, role))).collect())
}

/// Textures to load, each file once for each role.
struct Requests<'a> {
    folder: &'a Folder,
    list: Vec<Request>,
    ids: HashMap<(PathBuf, Role), usize>,
}

impl Requests<'_> {
    fn add(&mut self, name: &str, role: Role, material: usize) -> Result<usize, String> {
        let path = self.folder.resolve(name).map_err(|refusal| refusal.to_string())?;
        let next = self.list.len();
        let id = *self.ids.entry((path.clone(), role)).or_insert(next);
        if id == next {
            self.list.push(Request { path, role, name: name.to_owned(), material });
        }
        Ok(id)
    }
}

/// Reads and decodes all textures into the scene; the id of each, or `None` and a warning.
fn load(requests: &[Request], scene: &mut Scene) -> Vec<Option<TextureId>> {
    let decoded: Vec<Result<Texture, String>> = requests.par_iter().map(decode).collect();
    let mut ids = Vec::with_capacity(requests.len());
    for (request, decoded) in requests.iter().zip(decoded) {
        ids.push(match decoded {
            Ok(texture) => {
                let id = u32::try_from(scene.textures.len()).ok().map(TextureId);
                scene.textures.push(texture);
                id
            }
            Err(message) => {
                scene.warnings.push(texture_warning(&scene.materials[request.material], &request.name, &message));
                None
            }
        });
    }
    ids
}

fn decode(request: &Request) -> Result<Texture, String> {
    let bytes = std::fs::read(&request.path).map_err(|error| error.to_string())?;
    let texture = image::decode(&request.name, &bytes).map_err(|error| error.to_string())?;
    Ok(match request.role {
        Role::BaseColor => texture,
        Role::Mask => image::into_mask(texture),
    })
}

fn texture_warning(material: &Material, file: &str, message: &str) -> String {
    let (material, file) = (text::quoted(material.name.as_bytes()), text::quoted(file.as_bytes()));
    format!("material {material}: texture {file} is left out: {message}")
}

#[cfg(test)]
mod tests;
