//! Materials used by faces: parses MTL libraries, converts their materials and decodes textures in parallel.
//!
//! Libraries are read with the PBR keys `Pr`, `Pm` and `norm`. Other keys that affect rendering are reported as unsupported; hints and
//! rasterizer settings are ignored.

use std::collections::{HashMap, HashSet};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::read::error::{ReadError, WarningGroups};
use crate::read::folder::Folder;
use crate::read::image;
use crate::read::input::ReadOptions;
use crate::read::text::{self, Line};
use crate::{AlphaMode, Material, Scene, Texture, TextureId, TextureRef, UvTransform, Wrap};

/// The material slot of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Role {
    BaseColor,
    Mask,
    Emission,
    /// A normal map, or heights, as statements of bumps have either.
    Normals,
    /// Luminance in green.
    Roughness,
    /// Luminance in blue.
    Metallic,
}

/// A texture to load and the first material that uses it.
struct Request {
    path: PathBuf,
    /// Its role there, by which the image is converted.
    role: Role,
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
    options: &ReadOptions,
    libraries: &[&[u8]],
    names: &[Option<&[u8]>],
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let folder = Folder::of(path, options).map_err(ReadError::io(path))?;
    let files = library_files(&folder, libraries, &mut scene.warnings);
    let mut library = HashMap::new();
    for (name, bytes) in &files {
        library.extend(parse_library(name, bytes, &mut scene.warnings));
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
        if is_opaque_of_meshlab(source) {
            let location = format!("material {}", text::quoted(name.unwrap_or_default()));
            grouped.add("reading Tr 1 as opaque, as MeshLab writes it", &location);
        }
        if scene.materials[k].is_invisible() {
            let location = format!("material {}", text::quoted(name.unwrap_or_default()));
            grouped.add("a fully transparent material is not seen", &location);
        }
        for (map, role) in maps(source) {
            match requests.add(map, role, k) {
                Ok(request) => wanted.push((k, role, map, request)),
                Err(error) => grouped.add_sentence(&error, &texture_warning(&scene.materials[k], &map.file, &error)),
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
    for argument in statements.iter().map(|statement| String::from_utf8_lossy(text::unquoted(statement))) {
        let names = match folder.find(&argument) {
            Ok(_) => vec![&argument[..]],
            Err(_) => argument.split_ascii_whitespace().collect(),
        };
        for name in names {
            // Files may be referenced thousands of times; missing ones are identified by name.
            let path = folder.find(name).unwrap_or_else(|_| PathBuf::from(name));
            if !known.insert(path) {
                continue;
            }
            match folder.read_image(name) {
                Ok(bytes) => files.push((name.to_owned(), text::from_utf16(bytes))),
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

/// Textures to load, one per file, kind of content and wrap mode.
struct Requests<'a> {
    folder: &'a Folder,
    list: Vec<Request>,
    ids: HashMap<(PathBuf, Role, Wrap), usize>,
}

impl Requests<'_> {
    fn add(&mut self, map: &Map, role: Role, material: usize) -> Result<usize, String> {
        let find = |name: &str| self.folder.find(name);
        let path =
            find(&map.file).or_else(|error| other_names(&map.file).find_map(|name| find(&name).ok()).ok_or(error))?;
        let (next, wrap) = (self.list.len(), map.wrap());
        // Both are colors.
        let role = if role == Role::Emission { Role::BaseColor } else { role };
        let id = *self.ids.entry((path.clone(), role, wrap)).or_insert(next);
        if id == next {
            self.list.push(Request { path, role, wrap, name: map.file.clone(), material });
        }
        Ok(id)
    }
}

/// What a name that no file has may stand for: a name before a comment, and one with percent escapes.
fn other_names(name: &str) -> impl Iterator<Item = String> {
    let before = name.split_once(" #").map(|(before, _)| before.trim_end().to_owned());
    let plain = String::from_utf8(text::unescaped(name)).ok().filter(|plain| plain != name);
    before.into_iter().chain(plain)
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
    Ok(match request.role {
        Role::BaseColor | Role::Emission => texture,
        Role::Mask => image::into_mask(texture),
        Role::Normals => image::into_normals(texture),
        Role::Roughness => image::into_channel(texture, 1),
        Role::Metallic => image::into_channel(texture, 2),
    })
}

fn texture_warning(material: &Material, file: &str, message: &str) -> String {
    let (material, file) = (text::quoted(material.name.as_bytes()), text::quoted(file.as_bytes()));
    format!("skipping texture {file} of material {material}: {message}")
}

/// Converts a material.
///
/// The default is Lambertian: exporters write a gray `Ks` and some `Ns` for materials they do not support, so these alone do not
/// add a specular lobe. `Pr` and `Pm` give a metallic-roughness material, `illum` 3 and 5 a mirror of color `Ks` and texture
/// `map_Ks`, `illum` 4, 6, 7 and 9 glass of color `Tf` with index `Ni`; both are smooth without `Pr`. Alpha is `d`, or 1 - `Tr`; glass has none. `d`
/// takes precedence because some exporters invert `Tr`.
fn surface(name: String, source: &MtlMaterial) -> Material {
    let plain = Material { name, ..Material::default() };
    let default_color = if source.base_color_map.is_some() { [1.0; 3] } else { plain.base_color };
    let base_color = source.base_color.unwrap_or(default_color);
    let smooth = source.roughness.unwrap_or(0.0);
    let mut material = Material { base_color, emission: source.emission.unwrap_or_default(), ..plain };
    let is_physical = source.roughness.is_some()
        || source.metallic.is_some()
        || source.roughness_map.is_some()
        || source.metallic_map.is_some();
    match source.illumination {
        Some(4 | 6 | 7 | 9) => {
            material.base_color = source.filter.unwrap_or([1.0; 3]);
            (material.specular, material.transmission) = (1.0, 1.0);
            material.roughness = smooth;
            material.ior = source.ior.unwrap_or(material.ior);
            return material;
        }
        _ if is_mirror(source) => {
            let of_map = source.specular_map.as_ref().map(|_| [1.0; 3]);
            material.base_color = source.specular.or(of_map).unwrap_or(base_color);
            (material.specular, material.metallic) = (1.0, 1.0);
            material.roughness = smooth;
        }
        _ if is_physical => {
            // Without their number, maps are not scaled.
            let of_map = |map: bool| map.then_some(1.0);
            material.specular = 1.0;
            material.metallic = source.metallic.or(of_map(source.metallic_map.is_some())).unwrap_or(0.0);
            let rough = source.roughness.or(of_map(source.roughness_map.is_some()));
            material.roughness = rough.unwrap_or_else(|| roughness(source.shininess));
        }
        _ => {}
    }
    let of_transparency = || source.transparency.map(|transparency| 1.0 - transparency);
    let alpha = source.opacity.or_else(|| of_transparency().filter(|_| !is_opaque_of_meshlab(source)));
    if let Some(alpha) = alpha.filter(|&alpha| alpha < 1.0 && source.mask.is_none()) {
        material.alpha = alpha;
        material.alpha_mode = AlphaMode::Blend;
    }
    material
}

/// Whether the material is a mirror of color `Ks`, which replaces `Kd`.
fn is_mirror(source: &MtlMaterial) -> bool {
    matches!(source.illumination, Some(3 | 5)) && source.metallic.is_none() && source.metallic_map.is_none()
}

/// Whether `Tr 1` is the opacity of an opaque material: MeshLab writes it in place of `d`, with an illumination model without transparency.
fn is_opaque_of_meshlab(source: &MtlMaterial) -> bool {
    source.opacity.is_none() && source.transparency == Some(1.0) && matches!(source.illumination, Some(0..=2))
}

/// Roughness from a shininess of 1000 (1 - roughness)², as Blender writes it; 1 if absent.
fn roughness(shininess: Option<f32>) -> f32 {
    1.0 - (shininess.unwrap_or(0.0) / 1000.0).min(1.0).sqrt()
}

/// Unsupported texture keys.
const UNSUPPORTED_MAPS: &str = "disp map_disp decal map_decal refl map_refl map_Ns map_Tr \
                           map_Tf map_Ps map_Pc map_RMA map_ORM map_aniso";

/// Unsupported strengths of sheen, clearcoat and anisotropy. 0 disables them, as Blender writes for every material. `Pcr` and
/// `anisor` have no effect without them.
const UNSUPPORTED_FACTORS: &str = "Ps Pc aniso";

/// A material of a library; `None` for keys that are absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MtlMaterial {
    /// `Kd`, in 0..=1.
    pub(crate) base_color: Option<[f32; 3]>,
    /// `Ks`, in 0..=1.
    pub(crate) specular: Option<[f32; 3]>,
    /// `Tf`, in 0..=1.
    pub(crate) filter: Option<[f32; 3]>,
    /// `Ke`, not negative.
    pub(crate) emission: Option<[f32; 3]>,
    /// `Ns`, not negative.
    pub(crate) shininess: Option<f32>,
    /// `Pr`, in 0..=1.
    pub(crate) roughness: Option<f32>,
    /// `Pm`, in 0..=1.
    pub(crate) metallic: Option<f32>,
    /// `Ni`, from 1 to [`Material::MAX_IOR`].
    pub(crate) ior: Option<f32>,
    /// `illum`.
    pub(crate) illumination: Option<u32>,
    /// `d`, in 0..=1.
    pub(crate) opacity: Option<f32>,
    /// `Tr`, in 0..=1.
    pub(crate) transparency: Option<f32>,
    /// `map_Kd`.
    pub(crate) base_color_map: Option<Map>,
    /// `map_Ks`.
    pub(crate) specular_map: Option<Map>,
    /// `map_d`.
    pub(crate) mask: Option<Map>,
    /// `map_Ke`.
    emission_map: Option<Map>,
    /// `norm`, or a bump statement.
    pub(crate) normal_map: Option<Map>,
    /// Whether `normal_map` is of `norm`, and so not of heights.
    has_norm: bool,
    /// `map_Pr`.
    roughness_map: Option<Map>,
    /// `map_Pm`.
    metallic_map: Option<Map>,
    /// Unsupported keys.
    pub(crate) unsupported: Vec<&'static str>,
}

/// Materials of a library by name; the last of several with the same name wins. Invalid lines become warnings.
pub(crate) fn parse_library<'a>(
    file: &str,
    bytes: &'a [u8],
    warnings: &mut Vec<String>,
) -> HashMap<&'a [u8], MtlMaterial> {
    let mut library = HashMap::new();
    let mut current: Option<(&[u8], MtlMaterial)> = None;
    for line in text::lines(bytes) {
        if line.keyword.eq_ignore_ascii_case(b"newmtl") {
            library.extend(current.replace((line.rest, MtlMaterial::default())));
        } else if let Some((name, material)) = &mut current
            && let Err(problem) = material.read(&line)
        {
            let warning = format!("{file}: line {}: material {}: {problem}", line.number, text::quoted(name));
            warnings.push(text::printable(&warning).into_owned());
        }
    }
    library.extend(current);
    library
}

impl MtlMaterial {
    /// Reads one line, whose keyword may be in any case; the error is a warning.
    fn read(&mut self, line: &Line) -> Result<(), String> {
        match &line.keyword.to_ascii_lowercase()[..] {
            b"kd" => store(&mut self.base_color, color(line, 1.0), line),
            b"ke" => store(&mut self.emission, color(line, f32::MAX), line),
            // Only used for mirrors and glass, so invalid values are not reported.
            b"ks" => {
                self.specular = color(line, 1.0).ok().map(|(_, kept)| kept);
                Ok(())
            }
            b"tf" => {
                self.filter = color(line, 1.0).ok().map(|(_, kept)| kept);
                Ok(())
            }
            b"ns" => store(&mut self.shininess, number(line, 0.0..=f32::MAX), line),
            b"pr" => store(&mut self.roughness, number(line, 0.0..=1.0), line),
            b"pm" => store(&mut self.metallic, number(line, 0.0..=1.0), line),
            b"ni" => store(&mut self.ior, number(line, 1.0..=Material::MAX_IOR), line),
            b"d" => store(&mut self.opacity, number(line, 0.0..=1.0), line),
            b"tr" => store(&mut self.transparency, number(line, 0.0..=1.0), line),
            b"illum" => {
                let number = text::words(line.rest).next().and_then(|word| std::str::from_utf8(word).ok());
                self.illumination = number.and_then(|number| number.parse().ok());
                Ok(())
            }
            b"map_kd" => texture(&mut self.base_color_map, line),
            b"map_ks" => texture(&mut self.specular_map, line),
            b"map_d" => texture(&mut self.mask, line),
            b"map_ke" => texture(&mut self.emission_map, line),
            b"norm" => {
                self.has_norm = true;
                texture(&mut self.normal_map, line)
            }
            b"bump" | b"map_bump" => {
                // `norm` takes precedence.
                if self.has_norm { Ok(()) } else { texture(&mut self.normal_map, line) }
            }
            b"map_pr" => texture(&mut self.roughness_map, line),
            b"map_pm" => texture(&mut self.metallic_map, line),
            _ => {
                self.note_unsupported(line);
                Ok(())
            }
        }
    }

    /// Records an unsupported key once.
    fn note_unsupported(&mut self, line: &Line) {
        let known =
            |names: &'static str| names.split(' ').find(|name| name.as_bytes().eq_ignore_ascii_case(line.keyword));
        let is_none = || text::words(line.rest).all(|word| text::float(word) == Some(0.0));
        let name = known(UNSUPPORTED_MAPS).or_else(|| known(UNSUPPORTED_FACTORS).filter(|_| !is_none()));
        self.unsupported.extend(name.filter(|name| !self.unsupported.contains(name)));
    }
}

/// Stores a value clamped to its range; the error reports clamping.
fn store<T: Copy + PartialEq>(slot: &mut Option<T>, values: Result<(T, T), String>, line: &Line) -> Result<(), String> {
    let (value, clamped) = values?;
    *slot = Some(clamped);
    if value == clamped {
        return Ok(());
    }
    let keyword = String::from_utf8_lossy(line.keyword);
    Err(format!("clamping {keyword} {} to the valid range", text::quoted(line.rest)))
}

/// Stores a texture; the error lists ignored options.
fn texture(slot: &mut Option<Map>, line: &Line) -> Result<(), String> {
    let (map, unsupported) = read_map(line)?;
    *slot = Some(map);
    if unsupported.is_empty() {
        return Ok(());
    }
    let keyword = String::from_utf8_lossy(line.keyword);
    Err(format!("ignoring options of {keyword}: {}", unsupported.join(", ")))
}

/// The number of a line and its clamped value.
fn number(line: &Line, range: RangeInclusive<f32>) -> Result<(f32, f32), String> {
    let value = text::words(line.rest).find(|&word| word != b"-halo").and_then(text::float);
    let value = value.filter(|value| !value.is_nan()).ok_or_else(|| invalid(line, "a number"))?;
    Ok((value, value.clamp(*range.start(), *range.end())))
}

/// The color of a line and its components clamped to `0..=max`. A single number is gray.
fn color(line: &Line, max: f32) -> Result<([f32; 3], [f32; 3]), String> {
    let numbers: Option<Vec<f32>> = text::words(line.rest).take(4).map(text::float).collect();
    let color = match numbers.as_deref() {
        Some(&[gray]) => [gray; 3],
        Some(&[r, g, b]) => [r, g, b],
        _ => return Err(invalid(line, "1 or 3 numbers")),
    };
    if color.iter().any(|component| component.is_nan()) {
        return Err(invalid(line, "numbers"));
    }
    Ok((color, color.map(|component| component.clamp(0.0, max))))
}

fn invalid(line: &Line, expected: &str) -> String {
    let keyword = String::from_utf8_lossy(line.keyword);
    format!("ignoring {keyword} {}: expected {expected}", text::quoted(line.rest))
}

/// A texture statement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Map {
    /// File name; may contain spaces.
    pub(crate) file: String,
    /// `-s` for u and v.
    scale: [f32; 2],
    /// `-o` for u and v.
    offset: [f32; 2],
    /// `-clamp`.
    is_clamped: bool,
    /// `-bm`: strength of a normal map.
    pub(crate) strength: f32,
}

impl Default for Map {
    /// Without options and file name.
    fn default() -> Self {
        Self { file: String::new(), scale: [1.0; 2], offset: [0.0; 2], is_clamped: false, strength: 1.0 }
    }
}

impl Map {
    /// Wrap mode.
    pub(crate) fn wrap(&self) -> Wrap {
        if self.is_clamped { Wrap::Clamp } else { Wrap::Repeat }
    }

    /// The texture reference, looked up at `scale * uv + offset`.
    ///
    /// The importers of Blender and three.js do the same; the specification is ambiguous.
    pub(crate) fn texture_ref(&self, texture: TextureId) -> TextureRef {
        let ([scale_u, scale_v], [offset_u, offset_v]) = (self.scale, self.offset);
        let texture_from_mesh = UvTransform { rows: [[scale_u, 0.0, offset_u], [0.0, scale_v, offset_v]] };
        TextureRef { texture_from_mesh, ..TextureRef::new(texture) }
    }
}

/// Effect of an option.
#[derive(Clone, Copy)]
enum Effect {
    Scale,
    Offset,
    Clamp,
    Strength,
    /// Not supported, unless the arguments are these defaults.
    Unsupported(&'static [&'static str]),
    /// No effect on the supported textures.
    Ignored,
}

/// The options with their largest number of arguments. Trailing vector components are optional.
const OPTIONS: [(&str, usize, Effect); 14] = [
    ("-s", 3, Effect::Scale),
    ("-o", 3, Effect::Offset),
    ("-clamp", 1, Effect::Clamp),
    ("-bm", 1, Effect::Strength),
    ("-t", 3, Effect::Unsupported(&["0", "0", "0"])),
    ("-mm", 2, Effect::Unsupported(&["0", "1"])),
    ("-boost", 1, Effect::Unsupported(&["0"])),
    ("-blendu", 1, Effect::Unsupported(&["on"])),
    ("-blendv", 1, Effect::Unsupported(&["on"])),
    ("-cc", 1, Effect::Unsupported(&["off"])),
    ("-imfchan", 1, Effect::Unsupported(&["l"])),
    ("-texres", 1, Effect::Ignored),
    ("-type", 1, Effect::Ignored),
    // The content decides.
    ("-colorspace", 1, Effect::Ignored),
];

/// The texture of a statement and its unsupported options. The file name may be in quotes; options are before it, or after it.
pub(super) fn read_map(line: &Line) -> Result<(Map, Vec<&'static str>), String> {
    let mut map = Map::default();
    let mut unsupported = Vec::new();
    let mut read = |given: Given| {
        if map.apply(given.effect, &given.arguments).is_none() && !unsupported.contains(&given.name) {
            unsupported.push(given.name);
        }
    };
    let mut rest = line.rest;
    while let Some((given, after)) = option(rest) {
        read(given);
        rest = after;
    }
    let (name, options_after) = split_name(rest);
    options_after.into_iter().for_each(read);
    if name.is_empty() {
        return Err(format!("ignoring {}: no file name", String::from_utf8_lossy(line.keyword)));
    }
    map.file = String::from_utf8_lossy(name).into_owned();
    Ok((map, unsupported))
}

/// An option of a texture statement, as it is given.
struct Given<'a> {
    name: &'static str,
    effect: Effect,
    arguments: Vec<&'a [u8]>,
}

/// The option at the start of a text, and the text after it.
fn option(text: &[u8]) -> Option<(Given<'_>, &[u8])> {
    let (word, mut rest) = text::split_word(text);
    let &(name, max_arguments, effect) =
        OPTIONS.iter().find(|(name, ..)| word.eq_ignore_ascii_case(name.as_bytes()))?;
    let mut arguments = Vec::new();
    while arguments.len() < max_arguments {
        let (word, after) = text::split_word(rest);
        if word.is_empty() || !arguments.is_empty() && text::float(word).is_none() {
            break;
        }
        arguments.push(word);
        rest = after;
    }
    Some((Given { name, effect, arguments }, rest.trim_ascii_start()))
}

/// Most options that are read after a file name, so that the time for a long line is bounded.
const MAX_OPTIONS_AFTER: usize = 32;

/// Splits a file name from options after it. Words of a name may look like an option, so these are options only where all up to the
/// end of the line are, with sound arguments.
fn split_name(text: &[u8]) -> (&[u8], Vec<Given<'_>>) {
    if let [quote @ (b'"' | b'\''), inner @ ..] = text
        && let Some(end) = inner.iter().position(|byte| byte == quote)
    {
        let options = only_options(inner[end + 1..].trim_ascii_start());
        return (inner[..end].trim_ascii(), options.unwrap_or_default());
    }
    let is_start = |&at: &usize| text[at - 1].is_ascii_whitespace() && text[at] == b'-';
    let mut starts: Vec<usize> = (1..text.len()).rev().filter(is_start).take(MAX_OPTIONS_AFTER).collect();
    starts.reverse();
    for start in starts {
        if let Some(options) = only_options(&text[start..]) {
            return (text[..start].trim_ascii_end(), options);
        }
    }
    (text, Vec::new())
}

/// The options of a text that has nothing else and arguments that they support.
fn only_options(mut text: &[u8]) -> Option<Vec<Given<'_>>> {
    let (mut options, mut scratch) = (Vec::new(), Map::default());
    while !text.is_empty() {
        let (given, rest) = option(text)?;
        let is_sound = match given.effect {
            Effect::Unsupported(_) => given.arguments.iter().all(|word| is_argument(word)),
            Effect::Ignored => !given.arguments.is_empty(),
            effect => scratch.apply(effect, &given.arguments).is_some(),
        };
        options.push(Some(given).filter(|_| is_sound)?);
        text = rest;
    }
    Some(options)
}

/// Whether a word is a number, a switch or a channel.
fn is_argument(word: &[u8]) -> bool {
    text::float(word).is_some() || [&b"on"[..], b"off", b"r", b"g", b"b", b"m", b"l", b"z"].contains(&word)
}

impl Map {
    /// Applies an option; `None` if it is not supported.
    fn apply(&mut self, effect: Effect, arguments: &[&[u8]]) -> Option<()> {
        match effect {
            Effect::Scale => self.scale = vector(arguments, 1.0)?,
            Effect::Offset => self.offset = vector(arguments, 0.0)?,
            Effect::Clamp => {
                self.is_clamped = match arguments {
                    [b"on"] => true,
                    [b"off"] => false,
                    _ => return None,
                }
            }
            Effect::Strength => [self.strength, _] = vector(arguments, 0.0)?,
            Effect::Unsupported(neutral) => {
                return arguments.iter().zip(neutral).all(|(word, neutral)| is_same(word, neutral)).then_some(());
            }
            Effect::Ignored => {}
        }
        Some(())
    }
}

/// The first two of up to three finite numbers; `default` if the second is absent. The third is for 3D textures.
fn vector(arguments: &[&[u8]], default: f32) -> Option<[f32; 2]> {
    let number = |word: &&[u8]| text::float(word).filter(|number| number.is_finite());
    let numbers: Vec<f32> = arguments.iter().map(number).collect::<Option<_>>()?;
    let first = *numbers.first()?;
    Some([first, numbers.get(1).copied().unwrap_or(default)])
}

/// Whether two words are equal, or numbers of equal value.
fn is_same(word: &[u8], neutral: &str) -> bool {
    word == neutral.as_bytes()
        || text::float(word).is_some_and(|number| Some(number) == text::float(neutral.as_bytes()))
}

#[cfg(test)]
mod tests;
