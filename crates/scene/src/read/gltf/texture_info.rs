//! Texture references of materials, with `KHR_texture_transform`.

use gltf::json::deserialize::from_value;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;

use super::document::Document;
use crate::read::ReadError;
use crate::{UvSet, UvTransform};

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
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
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
