//! Where a material looks a texture up: which coordinates, and how `KHR_texture_transform` moves them.

use gltf::json::deserialize::from_value;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;

use super::document::Document;
use crate::read::ReadError;
use crate::{UvSet, UvTransform};

/// A texture as a material of the file refers to it.
#[derive(Clone, Debug)]
pub(super) struct Lookup {
    /// Index of the texture.
    pub(super) texture: usize,
    /// Number of the coordinate set.
    set: u32,
    transform: Option<TextureTransform>,
}

impl From<&Info> for Lookup {
    fn from(info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        Self::new(info.index.value(), info.tex_coord, transform)
    }
}

impl Lookup {
    /// The extension overrides the set.
    fn new(texture: usize, set: u32, transform: Option<TextureTransform>) -> Self {
        Self { texture, set: transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(set), transform }
    }

    /// The lookup of a normal texture, whose extensions the `gltf` crate leaves as JSON.
    pub(super) fn of_normals(source: &NormalTexture, document: &Document<'_>, place: &str) -> Result<Self, ReadError> {
        let extension =
            source.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_texture_transform"));
        let transform = extension
            .map(|value| from_value(value.clone()))
            .transpose()
            .map_err(|error| document.malformed(place, format!("its KHR_texture_transform: {error}")))?;
        Ok(Self::new(source.index.value(), source.tex_coord, transform))
    }

    /// Which of a mesh's coordinates; `Err` with the number of a set that meshes do not keep.
    pub(super) fn uv_set(&self) -> Result<UvSet, u32> {
        match self.set {
            0 => Ok(UvSet::First),
            1 => Ok(UvSet::Second),
            other => Err(other),
        }
    }

    /// The transform for coordinates whose `v` points up, of the file's, whose `v` points down.
    ///
    /// The file's scales, rotates and moves. Its rotation is counter-clockwise as seen in the image; the matrix printed
    /// in the extension turns the other way, its example and the common viewers this way. `None` where it is not finite.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub(super) fn texture_from_mesh(&self) -> Option<UvTransform> {
        let Some(transform) = &self.transform else { return Some(UvTransform::IDENTITY) };
        let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
        let [scale_u, scale_v] = transform.scale.0.map(f64::from);
        let [offset_u, offset_v] = transform.offset.0.map(f64::from);
        // In the file: u' = cos su u + sin sv v + ou, v' = -sin su u + cos sv v + ov. Here v stands for 1 - v, and v' for 1 - v'.
        let rows = [
            [cos * scale_u, -sin * scale_v, offset_u + sin * scale_v],
            [sin * scale_u, cos * scale_v, 1.0 - offset_v - cos * scale_v],
        ];
        let rows = rows.map(|row| row.map(|x| x as f32));
        rows.as_flattened().iter().all(|x| x.is_finite()).then_some(UvTransform { rows })
    }
}
