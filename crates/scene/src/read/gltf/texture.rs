//! Textures: an image with a sampler. An image that cannot be read is a warning and leaves a plain colour.

use std::collections::HashMap;

use gltf::json::texture::WrappingMode;
use gltf::json::validation::Checked;

use super::document::Document;
use super::uri;
use crate::read::ReadError;
use crate::read::image;
use crate::{Scene, Texture, TextureId, Wrap};

/// The textures read so far.
pub(super) struct Textures<'a, 'b> {
    document: &'a Document<'b>,
    /// By image and wrap modes, as many textures share both. `None`: the image cannot be read.
    known: HashMap<(usize, [Wrap; 2]), Option<TextureId>>,
    /// Mean colours by image.
    means: HashMap<usize, [f32; 3]>,
}

impl<'a, 'b> Textures<'a, 'b> {
    pub(super) fn new(document: &'a Document<'b>) -> Self {
        Self { document, known: HashMap::new(), means: HashMap::new() }
    }

    /// Texture `index` of the file, added to the scene when it is first asked for; `None` where it cannot be read.
    pub(super) fn get(&mut self, index: usize, place: &str, scene: &mut Scene) -> Result<Option<TextureId>, ReadError> {
        let (image, wrap) = self.image_of(index, place)?;
        if let Some(&known) = self.known.get(&(image, wrap)) {
            return Ok(known);
        }
        let id = match (self.decode(image, place)?, u32::try_from(scene.textures.len())) {
            (Ok(texture), Ok(id)) => {
                scene.textures.push(Texture { wrap, ..texture });
                Some(TextureId(id))
            }
            (Err(warning), _) => {
                scene.warnings.push(warning);
                None
            }
            (Ok(_), Err(_)) => return Err(self.document.malformed(place, "names more textures than 32 bits count")),
        };
        self.known.insert((image, wrap), id);
        Ok(id)
    }

    /// Mean linear colour of texture `index` of the file, white where it cannot be read.
    pub(super) fn mean(&mut self, index: usize, place: &str, scene: &mut Scene) -> Result<[f32; 3], ReadError> {
        let (image, _) = self.image_of(index, place)?;
        if let Some(&mean) = self.means.get(&image) {
            return Ok(mean);
        }
        let mean = match self.decode(image, place)? {
            Ok(texture) => mean_linear(&texture),
            Err(warning) => {
                scene.warnings.push(warning);
                [1.0; 3]
            }
        };
        self.means.insert(image, mean);
        Ok(mean)
    }

    /// The image of a texture and its wrap modes.
    fn image_of(&self, index: usize, place: &str) -> Result<(usize, [Wrap; 2]), ReadError> {
        let root = &self.document.root;
        let texture = self.document.get(&root.textures, index, "texture", place)?;
        let place = format!("texture {index}");
        let wrap = match texture.sampler {
            Some(sampler) => {
                let sampler = self.document.get(&root.samplers, sampler.value(), "sampler", &place)?;
                [sampler.wrap_s, sampler.wrap_t].map(wrap)
            }
            None => [Wrap::Repeat; 2],
        };
        self.document.get(&root.images, texture.source.value(), "image", &place)?;
        Ok((texture.source.value(), wrap))
    }

    /// Reads and decodes an image; the inner error is a warning.
    fn decode(&self, index: usize, place: &str) -> Result<Result<Texture, String>, ReadError> {
        let image = &self.document.root.images[index];
        let name = image.name.clone().unwrap_or_else(|| format!("image {index}"));
        let warning = |why: String| format!("image {index} {name:?} of {place}: {why}; a plain colour stands for it");
        let loaded;
        let bytes = match (image.buffer_view, &image.uri) {
            (Some(view), _) => self.document.view(view.value(), &format!("image {index}"))?.0,
            (None, Some(uri)) => match uri::load(uri, &self.document.folder) {
                Ok(bytes) => {
                    loaded = bytes;
                    &loaded[..]
                }
                Err(error) => return Ok(Err(warning(error.to_string()))),
            },
            (None, None) => return Ok(Err(warning("it has neither a buffer view nor a uri".to_owned()))),
        };
        Ok(image::decode(&name, bytes).map_err(|error| warning(error.to_string())))
    }
}

/// Unknown modes repeat, as missing ones do.
fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// Mean of the texels, decoded from sRGB (IEC 61966-2-1).
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn mean_linear(texture: &Texture) -> [f32; 3] {
    let decoded: [f64; 256] = std::array::from_fn(|byte| {
        let encoded = byte as f64 / 255.0;
        if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
    });
    let sum = |k: usize| texture.texels.iter().map(|texel| decoded[usize::from(texel[k])]).sum::<f64>();
    std::array::from_fn(|k| (sum(k) / texture.texels.len() as f64) as f32)
}
