//! Materials used by faces: looks them up in the libraries and decodes textures in parallel.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::surface::{is_mirror, surface};
use crate::read::folder::Folder;
use crate::read::mtl::{self, Map, MtlMaterial};
use crate::read::warning_groups::WarningGroups;
use crate::read::{ReadError, image, text};
use crate::{AlphaMode, Material, Scene, Texture, TextureId, TextureRef, Wrap};

/// The material slot of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    BaseColor,
    Mask,
    Emission,
    Normals,
    Roughness,
    Metallic,
}

/// How an image is converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Content {
    Color,
    Mask,
    /// A normal map, or heights, as statements of bumps have either.
    Bumps,
    /// Luminance in green.
    Roughness,
    /// Luminance in blue.
    Metallic,
}

impl Role {
    fn content(self) -> Content {
        match self {
            Self::BaseColor | Self::Emission => Content::Color,
            Self::Mask => Content::Mask,
            Self::Normals => Content::Bumps,
            Self::Roughness => Content::Roughness,
            Self::Metallic => Content::Metallic,
        }
    }
}

/// A texture to load and the first material that uses it.
struct Request {
    path: PathBuf,
    content: Content,
    wrap: Wrap,
    /// Name used in messages.
    name: String,
    material: usize,
}

/// Adds one material for each name, in order, and their textures.
///
/// A missing library, material or texture gives a warning and a default.
pub(super) fn materials(
    path: &Path,
    libraries: &[&[u8]],
    names: &[Option<&[u8]>],
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let folder = Folder::of(path).map_err(ReadError::io(path))?;
    let files = library_files(&folder, libraries, &mut scene.warnings);
    let mut library = HashMap::new();
    for (name, bytes) in &files {
        library.extend(mtl::parse(name, bytes, &mut scene.warnings));
    }

    let mut requests = Requests { folder: &folder, list: Vec::new(), ids: HashMap::new() };
    let (mut wanted, mut grouped) = (Vec::new(), WarningGroups::default());
    for (k, &name) in names.iter().enumerate() {
        let source = name.and_then(|name| find(&library, name, &mut scene.warnings));
        let display_name = String::from_utf8_lossy(name.unwrap_or_default()).into_owned();
        let Some(source) = source else {
            scene.materials.push(Material { name: display_name, ..Material::default() });
            continue;
        };
        scene.materials.push(surface(display_name, source));
        if scene.materials[k].is_invisible() {
            let location = format!("material {}", text::quoted(name.unwrap_or_default()));
            grouped.add("a fully transparent material is not seen", &location);
        }
        for (map, role) in maps(source) {
            match requests.add(map, role.content(), k) {
                Ok(request) => wanted.push((k, role, map, request)),
                Err(error) => scene.warnings.push(texture_warning(&scene.materials[k], &map.file, &error)),
            }
        }
        let others = unsupported_filter(source, &scene.materials[k]).into_iter().chain(unused_specular_map(source));
        for keyword in source.unsupported.iter().copied().chain(others) {
            let location = format!("material {}", text::quoted(name.unwrap_or_default()));
            grouped.add(&format!("ignoring {keyword} (not supported)"), &location);
        }
    }
    grouped.finish(&mut scene.warnings);

    let textures = load(&requests.list, scene);
    for (k, role, map, request) in wanted {
        if let Some(texture) = textures[request] {
            assign(scene, k, role, map, texture);
        }
    }
    scene.files = folder.found();
    Ok(())
}

/// The material of a name, else the first one, by name, whose name differs only in case.
fn find<'a>(
    library: &'a HashMap<&[u8], MtlMaterial>,
    name: &[u8],
    warnings: &mut Vec<String>,
) -> Option<&'a MtlMaterial> {
    if let Some(material) = library.get(name) {
        return Some(material);
    }
    let wanted = text::quoted(name);
    let similar = library.iter().filter(|(known, _)| known.eq_ignore_ascii_case(name)).min_by_key(|&(known, _)| known);
    warnings.push(similar.map_or_else(
        || format!("material {wanted} not found in any library; using the default material"),
        |(known, _)| {
            format!("material {wanted} not found in any library; using {}, whose case differs", text::quoted(known))
        },
    ));
    similar.map(|(_, material)| material)
}

/// Names and contents of all `mtllib` files, each once. A statement is one name with spaces if that file exists, else several.
fn library_files(folder: &Folder, statements: &[&[u8]], warnings: &mut Vec<String>) -> Vec<(String, Vec<u8>)> {
    let (mut known, mut files) = (HashSet::new(), Vec::new());
    for argument in statements.iter().map(|statement| String::from_utf8_lossy(statement)) {
        let names = match folder.resolve(&argument) {
            Ok(_) => vec![&argument[..]],
            Err(_) => argument.split_ascii_whitespace().collect(),
        };
        for name in names {
            // Files may be referenced thousands of times; missing ones are identified by name.
            let path = folder.resolve(name).unwrap_or_else(|_| PathBuf::from(name));
            if !known.insert(path) {
                continue;
            }
            match folder.read(name) {
                Ok(bytes) => files.push((name.to_owned(), bytes)),
                Err(error) => {
                    warnings.push(format!("cannot read material library {}: {error}", text::quoted(name.as_bytes())))
                }
            }
        }
    }
    files
}

/// Textures of a material. An emission texture is skipped if `Ke` is black. That of `map_Ks` replaces the one of `map_Kd` in mirrors.
fn maps(source: &MtlMaterial) -> impl Iterator<Item = (&Map, Role)> {
    let specular_map = source.specular_map.as_ref().filter(|_| is_mirror(source));
    let emission_map = source.emission_map.as_ref().filter(|_| source.emission != Some([0.0; 3]));
    let maps = [
        (specular_map.or(source.base_color_map.as_ref()), Role::BaseColor),
        (source.mask.as_ref(), Role::Mask),
        (emission_map, Role::Emission),
        (source.normal_map.as_ref(), Role::Normals),
        (source.roughness_map.as_ref(), Role::Roughness),
        (source.metallic_map.as_ref(), Role::Metallic),
    ];
    maps.into_iter().filter_map(|(map, role)| Some((map?, role)))
}

/// `Tf` if it would have an effect but the material is not glass. Exporters write all or nothing for opaque surfaces.
fn unsupported_filter(source: &MtlMaterial, material: &Material) -> Option<&'static str> {
    let has_effect = source.filter.is_some_and(|filter| filter != [1.0; 3] && filter != [0.0; 3]);
    (has_effect && material.transmission == 0.0).then_some("Tf")
}

/// `map_Ks` of other materials than mirrors: they have no texture for the strength of the reflection.
fn unused_specular_map(source: &MtlMaterial) -> Option<&'static str> {
    (source.specular_map.is_some() && !is_mirror(source)).then_some("map_Ks")
}

fn assign(scene: &mut Scene, material: usize, role: Role, map: &Map, texture: TextureId) {
    let mut texture = map.texture_ref(texture);
    let roughness = scene.materials[material].metallic_roughness_texture;
    if let (Role::Metallic, Some(roughness)) = (role, roughness) {
        // Both are channels of one texture.
        let [a, b] = [roughness.texture, texture.texture].map(|id| &scene.textures[id.0 as usize]);
        let Some((both, id)) = image::joined(a, b).zip(u32::try_from(scene.textures.len()).ok().map(TextureId)) else {
            let name = &scene.materials[material];
            scene.warnings.push(texture_warning(name, &map.file, "its size differs from that of map_Pr"));
            return;
        };
        scene.textures.push(both);
        texture = TextureRef { texture: id, ..roughness };
    }
    let material = &mut scene.materials[material];
    match role {
        Role::Roughness | Role::Metallic => material.metallic_roughness_texture = Some(texture),
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
            // Without `Ke` the texture is not scaled.
            if !material.is_emissive() {
                material.emission = [1.0; 3];
            }
        }
    }
}

/// Textures to load, one per file, content and wrap mode.
struct Requests<'a> {
    folder: &'a Folder,
    list: Vec<Request>,
    ids: HashMap<(PathBuf, Content, Wrap), usize>,
}

impl Requests<'_> {
    fn add(&mut self, map: &Map, content: Content, material: usize) -> Result<usize, String> {
        let path = self.folder.resolve(&map.file)?;
        let (next, wrap) = (self.list.len(), map.wrap());
        let id = *self.ids.entry((path.clone(), content, wrap)).or_insert(next);
        if id == next {
            self.list.push(Request { path, content, wrap, name: map.file.clone(), material });
        }
        Ok(id)
    }
}

/// Loads all textures into the scene; the id of each, or `None` with a warning.
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
    let texture = image::decode(&request.name, &bytes)?;
    let texture = Texture { wrap: [request.wrap; 2], ..texture };
    Ok(match request.content {
        Content::Color => texture,
        Content::Mask => image::into_mask(texture),
        Content::Bumps => image::into_normals(texture),
        Content::Roughness => image::into_channel(texture, 1),
        Content::Metallic => image::into_channel(texture, 2),
    })
}

fn texture_warning(material: &Material, file: &str, message: &str) -> String {
    let (material, file) = (text::quoted(material.name.as_bytes()), text::quoted(file.as_bytes()));
    format!("skipping texture {file} of material {material}: {message}")
}

#[cfg(test)]
mod tests;
