//! The materials that faces use: recipes looked up in the libraries, textures decoded in parallel.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::surface::surface;
use crate::read::folder::Folder;
use crate::read::mtl::{self, Map, Recipe};
use crate::read::remarks::Remarks;
use crate::read::{ReadError, image, text};
use crate::{AlphaMode, Encoding, Material, Scene, Texture, TextureId, Wrap};

/// What a texture is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    BaseColor,
    Mask,
    Emission,
    Normals,
}

/// What an image is made into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Content {
    Color,
    Mask,
    Numbers,
}

impl Role {
    fn content(self) -> Content {
        match self {
            Self::BaseColor | Self::Emission => Content::Color,
            Self::Mask => Content::Mask,
            Self::Normals => Content::Numbers,
        }
    }
}

/// A texture and the first material that asks for it.
struct Request {
    path: PathBuf,
    content: Content,
    wrap: Wrap,
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
    let (mut wanted, mut remarks) = (Vec::new(), Remarks::default());
    for (k, &name) in names.iter().enumerate() {
        let recipe = name.and_then(|name| recipes.get(name));
        if let (Some(name), None) = (name, recipe) {
            scene.warnings.push(format!("material {} is in no library; it is plain grey", text::quoted(name)));
        }
        let shown_name = String::from_utf8_lossy(name.unwrap_or_default()).into_owned();
        let Some(recipe) = recipe else {
            scene.materials.push(Material { name: shown_name, ..Material::default() });
            continue;
        };
        scene.materials.push(surface(shown_name, recipe));
        for (map, role) in maps(recipe) {
            match requests.add(map, role.content(), k) {
                Ok(request) => wanted.push((k, role, map, request)),
                Err(refusal) => scene.warnings.push(texture_warning(&scene.materials[k], &map.file, &refusal)),
            }
        }
        for keyword in recipe.ignored.iter().copied().chain(ignored_filter(recipe, &scene.materials[k])) {
            let place = format!("material {}", text::quoted(name.unwrap_or_default()));
            remarks.note(&format!("{keyword} is ignored"), &place);
        }
    }
    remarks.finish(&mut scene.warnings);

    let textures = load(&requests.list, scene);
    for (k, role, map, request) in wanted {
        if let Some(texture) = textures[request] {
            assign(&mut scene.materials[k], role, map, texture);
        }
    }
    scene.files = folder.into_found();
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

/// The textures that a material wants. Where it emits nothing by its own word, a texture of that is none.
fn maps(recipe: &Recipe) -> impl Iterator<Item = (&Map, Role)> {
    let emission_map = recipe.emission_map.as_ref().filter(|_| recipe.emission != Some([0.0; 3]));
    let maps = [
        (recipe.base_color_map.as_ref(), Role::BaseColor),
        (recipe.mask.as_ref(), Role::Mask),
        (emission_map, Role::Emission),
        (recipe.normal_map.as_ref(), Role::Normals),
    ];
    maps.into_iter().filter_map(|(map, role)| Some((map?, role)))
}

/// `Tf`, where it says something and the surface is no glass, which alone is filtered. All or nothing is what exporters write
/// for surfaces that let no light through.
fn ignored_filter(recipe: &Recipe, material: &Material) -> Option<&'static str> {
    let says_something = recipe.filter.is_some_and(|filter| filter != [1.0; 3] && filter != [0.0; 3]);
    (says_something && material.transmission == 0.0).then_some("Tf")
}

fn assign(material: &mut Material, role: Role, map: &Map, texture: TextureId) {
    let texture = map.placed(texture);
    match role {
        Role::BaseColor => material.base_color_texture = Some(texture),
        Role::Normals => {
            material.normal_texture = Some(texture);
            material.normal_scale = map.strength;
        }
        Role::Mask => {
            material.alpha_texture = Some(texture);
            material.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        }
        Role::Emission => {
            material.emission_texture = Some(texture);
            // A texture of which the material says no strength is as strong as it looks.
            if !material.is_emissive() {
                material.emission = [1.0; 3];
            }
        }
    }
}

/// Textures to load, each file once for each content and each way to go on beyond its border.
struct Requests<'a> {
    folder: &'a Folder,
    list: Vec<Request>,
    ids: HashMap<(PathBuf, Content, Wrap), usize>,
}

impl Requests<'_> {
    fn add(&mut self, map: &Map, content: Content, material: usize) -> Result<usize, String> {
        let path = self.folder.resolve(&map.file).map_err(|refusal| refusal.to_string())?;
        let (next, wrap) = (self.list.len(), map.wrap());
        let id = *self.ids.entry((path.clone(), content, wrap)).or_insert(next);
        if id == next {
            self.list.push(Request { path, content, wrap, name: map.file.clone(), material });
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
    let texture = Texture { wrap: [request.wrap; 2], ..texture };
    Ok(match request.content {
        Content::Color => texture,
        Content::Mask => image::into_mask(texture),
        Content::Numbers => Texture { encoding: Encoding::Linear, ..texture },
    })
}

fn texture_warning(material: &Material, file: &str, message: &str) -> String {
    let (material, file) = (text::quoted(material.name.as_bytes()), text::quoted(file.as_bytes()));
    format!("material {material}: texture {file} is left out: {message}")
}

#[cfg(test)]
mod tests;
