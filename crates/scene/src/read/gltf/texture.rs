//! Textures: an image with a sampler, and the references of materials, with `KHR_texture_transform`. Unreadable images are skipped with a
//! warning.

use std::collections::{HashMap, HashSet};

use gltf::json::deserialize::from_value;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::{Info, MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use rayon::prelude::*;

use super::container::load_image;
use super::document::Document;
use crate::read::error::{ReadError, WarningGroups};
use crate::read::image;
use crate::read::text::{self, printable};
use crate::{Encoding, Magnification, Scene, Texture, TextureId, UvSet, UvTransform, Wrap};

/// Textures requested by materials.
pub(super) struct Textures<'a, 'b> {
    pub(super) document: &'a Document<'b>,
    requests: Vec<Request>,
    /// Index into `requests`; textures with equal keys are shared.
    known: HashMap<Key, TextureId>,
}

/// Image index, wrap modes, encoding, and the bits of a factor where roughness is made from glossiness.
type Key = (usize, [Wrap; 2], Magnification, Encoding, Option<u32>);

/// Value of the `gltf` crate for a texture without an image.
const NO_SOURCE: usize = u32::MAX as usize;

/// Extensions that name an image of another format, with its feature.
const FORMATS: [(&str, &str, bool); 2] =
    [("KHR_texture_basisu", "ktx2", cfg!(feature = "ktx2")), ("EXT_texture_webp", "webp", cfg!(feature = "webp"))];

struct Request {
    key: Key,
    /// Image to use where that of the key cannot be read.
    fallback: Option<usize>,
    /// The first material that uses it.
    location: String,
}

impl<'a, 'b> Textures<'a, 'b> {
    pub(super) fn new(document: &'a Document<'b>) -> Self {
        Self { document, requests: Vec::new(), known: HashMap::new() }
    }

    /// A temporary id of texture `index`, valid until [`Textures::load`]; `None` with a warning if it has no supported image.
    pub(super) fn request(
        &mut self,
        index: usize,
        encoding: Encoding,
        glossiness: Option<u32>,
        location: &str,
        grouped: &mut WarningGroups,
    ) -> Result<Option<TextureId>, ReadError> {
        let Some((key, fallback)) = self.key(index, encoding, glossiness, location, grouped)? else { return Ok(None) };
        let next = u32::try_from(self.requests.len())
            .map_err(|_| self.document.malformed(location, "too many textures (limit: 2^32)"))?;
        let id = *self.known.entry(key).or_insert(TextureId(next));
        if id.0 == next {
            self.requests.push(Request { key, fallback, location: location.to_owned() });
        }
        Ok(Some(id))
    }

    fn key(
        &self,
        index: usize,
        encoding: Encoding,
        glossiness: Option<u32>,
        location: &str,
        grouped: &mut WarningGroups,
    ) -> Result<Option<(Key, Option<usize>)>, ReadError> {
        let root = &self.document.root;
        let texture = self.document.get(&root.textures, index, "texture", location)?;
        let others = texture.extensions.as_ref().map(|all| &all.others);
        let better = FORMATS.iter().filter(|(.., is_built)| *is_built).find_map(|(name, ..)| {
            others?.get(*name)?.get("source")?.as_u64().map(|image| usize::try_from(image).unwrap_or(usize::MAX))
        });
        let plain = Some(texture.source.value()).filter(|&image| image != NO_SOURCE);
        let Some(image) = better.or(plain) else {
            let missing = |name: &str| {
                let feature = FORMATS.iter().find(|(its, _, is_built)| *its == name && !is_built);
                feature.map_or_else(|| name.to_owned(), |(_, feature, _)| format!("{name}, feature '{feature}'"))
            };
            let extensions: Vec<String> =
                others.into_iter().flat_map(|all| all.keys()).map(|name| missing(name)).collect();
            let what = match &extensions[..] {
                [] => "skipping a texture without an image".to_owned(),
                names => format!("skipping a texture whose image needs {} (not supported)", names.join(", ")),
            };
            grouped.add(&what, location);
            return Ok(None);
        };
        let location = format!("texture {index}");
        let (wrap, magnification) = match texture.sampler {
            Some(sampler) => {
                let sampler = self.document.get(&root.samplers, sampler.value(), "sampler", &location)?;
                ([sampler.wrap_s, sampler.wrap_t].map(wrap), magnification(sampler))
            }
            None => ([Wrap::Repeat; 2], Magnification::Linear),
        };
        for image in [Some(image), plain].into_iter().flatten() {
            self.document.get(&root.images, image, "image", &location)?;
        }
        Ok(Some(((image, wrap, magnification, encoding, glossiness), plain.filter(|&plain| plain != image))))
    }

    /// Decodes each image once, in parallel, and assigns the final texture ids to the materials.
    pub(super) fn load(mut self, scene: &mut Scene) -> Result<(), ReadError> {
        let (mut of_image, mut tried) = (HashMap::new(), HashSet::new());
        self.decode_all(&mut of_image, &mut tried, &mut scene.warnings)?;
        for request in &mut self.requests {
            if let Some(fallback) = request.fallback.filter(|_| !of_image.contains_key(&request.key.0)) {
                request.key.0 = fallback;
            }
        }
        self.decode_all(&mut of_image, &mut tried, &mut scene.warnings)?;
        let mut n_uses: HashMap<usize, usize> = HashMap::new();
        for Request { key: (image, ..), .. } in &self.requests {
            *n_uses.entry(*image).or_default() += 1;
        }
        let mut ids = Vec::with_capacity(self.requests.len());
        for Request { key: (image, wrap, magnification, encoding, glossiness), .. } in &self.requests {
            let n_left = n_uses.entry(*image).and_modify(|n| *n -= 1).or_default();
            // The last use takes the texels, so that an image used once is not copied.
            let texture = if *n_left == 0 { of_image.remove(image) } else { of_image.get(image).cloned() };
            ids.push(texture.map(|texture| {
                let (wrap, magnification, encoding) = (*wrap, *magnification, *encoding);
                let mut texture = Texture { wrap, magnification, encoding, ..texture };
                if let Some(factor) = glossiness {
                    roughen(&mut texture.texels, f32::from_bits(*factor));
                }
                scene.textures.push(texture);
                scene.textures.len() - 1
            }));
        }
        let id_of = |old: TextureId| ids[old.0 as usize].and_then(|id| u32::try_from(id).ok()).map(TextureId);
        for slot in scene.materials.iter_mut().flat_map(|material| material.textures_mut()) {
            *slot = slot.take().and_then(|old| Some(crate::TextureRef { texture: id_of(old.texture)?, ..old }));
        }
        Ok(())
    }
}

impl Textures<'_, '_> {
    /// Decodes the requested images that were not tried before, each once, in parallel.
    fn decode_all(
        &self,
        of_image: &mut HashMap<usize, Texture>,
        tried: &mut HashSet<usize>,
        warnings: &mut Vec<String>,
    ) -> Result<(), ReadError> {
        let images = self.requests.iter().map(|request| (request.key.0, &request.location[..]));
        let images: Vec<(usize, &str)> = images.filter(|(image, _)| tried.insert(*image)).collect();
        let decode = |&(image, location): &(usize, &str)| decode(self.document, image, location);
        let decoded: Vec<_> = images.par_iter().map(decode).collect();
        for (&(image, _), decoded) in images.iter().zip(decoded) {
            match decoded? {
                Ok(texture) => drop(of_image.insert(image, texture)),
                Err(warning) => warnings.push(warning),
            }
        }
        Ok(())
    }
}

/// Loads and decodes an image; the inner error is a warning.
fn decode(document: &Document<'_>, index: usize, location: &str) -> Result<Result<Texture, String>, ReadError> {
    let image = &document.root.images[index];
    let name = image.name.clone().unwrap_or_else(|| format!("image {index}"));
    let warning = |why: String| {
        let shown = text::quoted(name.as_bytes());
        printable(&format!("skipping image {index} {shown} of {location}: {why}")).into_owned()
    };
    let loaded;
    let bytes = match (image.buffer_view, &image.uri) {
        (Some(view), _) => document.view(view.value(), &format!("image {index}"))?.0,
        (None, Some(uri)) => match load_image(uri, &document.folder) {
            Ok(bytes) => {
                loaded = bytes;
                &loaded[..]
            }
            Err(error) => return Ok(Err(warning(error))),
        },
        (None, None) => return Ok(Err(warning("neither a buffer view nor a uri".to_owned()))),
    };
    Ok(image::decode(&name, bytes).map_err(warning))
}

/// Puts 1 minus the glossiness, `factor` times alpha, into the green channel.
fn roughen(texels: &mut [[u8; 4]], factor: f32) {
    let roughness: Vec<u8> = (0..=u8::MAX).map(|a| (255.0 - factor * f32::from(a)).round() as u8).collect();
    for texel in texels {
        *texel = [0, roughness[usize::from(texel[3])], 0, u8::MAX];
    }
}

/// The filter of a sampler; that of minification stands in for one that is not given.
fn magnification(sampler: &Sampler) -> Magnification {
    use MinFilter::{Nearest, NearestMipmapLinear, NearestMipmapNearest};
    let is_nearest = match sampler.mag_filter {
        Some(filter) => matches!(filter, Checked::Valid(MagFilter::Nearest)),
        None => {
            matches!(sampler.min_filter, Some(Checked::Valid(Nearest | NearestMipmapLinear | NearestMipmapNearest)))
        }
    };
    if is_nearest { Magnification::Nearest } else { Magnification::Linear }
}

/// Unknown modes repeat.
fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// A texture reference of a material.
#[derive(Clone, Debug)]
pub(super) struct TextureInfo {
    /// Index of the texture.
    pub(super) texture: usize,
    /// Texture coordinate set.
    set: u32,
    transform: Option<TextureTransform>,
}

impl From<&Info> for TextureInfo {
    fn from(info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        Self::new(info.index.value(), info.tex_coord, transform)
    }
}

impl TextureInfo {
    /// `transform` may override the set.
    fn new(texture: usize, set: u32, transform: Option<TextureTransform>) -> Self {
        Self { texture, set: transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(set), transform }
    }

    /// From a normal texture, whose extensions the `gltf` crate leaves as JSON.
    pub(super) fn from_normal_texture(
        source: &NormalTexture,
        document: &Document<'_>,
        location: &str,
    ) -> Result<Self, ReadError> {
        let extension =
            source.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_texture_transform"));
        let transform = extension
            .map(|value| from_value(value.clone()))
            .transpose()
            .map_err(|error| document.malformed(location, format!("invalid KHR_texture_transform: {error}")))?;
        Ok(Self::new(source.index.value(), source.tex_coord, transform))
    }

    /// The texture coordinate set; `Err` with an unsupported set number.
    pub(super) fn uv_set(&self) -> Result<UvSet, u32> {
        match self.set {
            0 => Ok(UvSet::First),
            1 => Ok(UvSet::Second),
            other => Err(other),
        }
    }

    /// The transform, converted from `v` down (glTF) to `v` up; `None` if not finite.
    ///
    /// It scales, rotates counter-clockwise in the image, and translates. The matrix in the extension's text rotates in the
    /// opposite direction, but its example and common viewers agree with this.
    pub(super) fn texture_from_mesh(&self) -> Option<UvTransform> {
        let Some(transform) = &self.transform else { return Some(UvTransform::IDENTITY) };
        let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
        let [scale_u, scale_v] = transform.scale.0.map(f64::from);
        let [offset_u, offset_v] = transform.offset.0.map(f64::from);
        // glTF: u' = cos su u + sin sv v + ou, v' = -sin su u + cos sv v + ov. Substitutes 1 - v for v and 1 - v' for v'.
        let rows = [
            [cos * scale_u, -sin * scale_v, offset_u + sin * scale_v],
            [sin * scale_u, cos * scale_v, 1.0 - offset_v - cos * scale_v],
        ];
        let rows = rows.map(|row| row.map(|x| x as f32));
        rows.as_flattened().iter().all(|x| x.is_finite()).then_some(UvTransform { rows })
    }
}
