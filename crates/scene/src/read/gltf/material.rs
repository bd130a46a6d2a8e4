//! Materials, as far as a Lambert surface with a mask can say them (glTF 2.0, section 3.9).

use gltf::json::Material as Source;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;

use super::document::Document;
use super::texture::Textures;
use crate::read::ReadError;
use crate::{Material, Scene, TextureRef};

/// Where the coordinates of a material's texture come from.
#[derive(Clone, Debug, Default)]
pub(super) struct UvSource {
    /// Number of the coordinate set.
    pub(super) set: u32,
    /// `KHR_texture_transform`.
    transform: Option<TextureTransform>,
}

impl UvSource {
    /// Coordinates for a scene, `v` up, of those in the file, `v` down.
    ///
    /// The transform scales, rotates and moves. Its rotation is counter-clockwise as seen in the image, where `v` points
    /// down; the matrix printed in the extension turns the other way, its example and the common viewers this way.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub(super) fn apply(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let Some(transform) = &self.transform else { return [u, 1.0 - v] };
        let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
        let [scaled_u, scaled_v] = [0, 1].map(|k| f64::from(transform.scale.0[k]) * f64::from([u, v][k]));
        let [offset_u, offset_v] = transform.offset.0.map(f64::from);
        let u = cos * scaled_u + sin * scaled_v + offset_u;
        let v = cos * scaled_v - sin * scaled_u + offset_v;
        [u as f32, (1.0 - v) as f32]
    }
}

/// Reads all materials, and behind them the default one if a primitive needs it, with their textures.
///
/// Returns where each finds its texture coordinates, `None` for one without a texture.
pub(super) fn read(document: &Document<'_>, scene: &mut Scene) -> Result<Vec<Option<UvSource>>, ReadError> {
    let mut textures = Textures::new(document);
    let mut uv_sources = Vec::new();
    for (k, source) in document.root.materials.iter().enumerate() {
        let (material, uv_source) = surface(k, source, &mut textures, scene)?;
        scene.materials.push(material);
        uv_sources.push(uv_source);
    }
    let mut primitives = document.root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if primitives.any(|primitive| primitive.material.is_none()) {
        scene.materials.push(Material { name: "default".to_owned(), base_color: [1.0; 3], ..Material::default() });
        uv_sources.push(None);
    }
    Ok(uv_sources)
}

fn surface(
    k: usize,
    source: &Source,
    textures: &mut Textures<'_, '_>,
    scene: &mut Scene,
) -> Result<(Material, Option<UvSource>), ReadError> {
    let place = format!("material {k}");
    let name = source.name.clone().unwrap_or_else(|| place.clone());
    let [albedo @ .., alpha] = source.pbr_metallic_roughness.base_color_factor.0;
    let mut material = Material { name, base_color: albedo.map(|x| x.clamp(0.0, 1.0)), ..Material::default() };
    if material.base_color != albedo {
        scene.warnings.push(format!("{place}: base colour {albedo:?} is clamped to 0..=1"));
    }

    let base_color = source.pbr_metallic_roughness.base_color_texture.as_ref();
    if let Some(info) = base_color {
        material.base_color_texture = textures.get(info.index.value(), &place, scene)?.map(TextureRef::plain);
    }
    let uv_source = base_color.filter(|_| material.base_color_texture.is_some()).map(|info| {
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        UvSource {
            set: transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord),
            transform,
        }
    });
    let cutoff = source.alpha_cutoff.unwrap_or_default().0;
    match source.alpha_mode {
        Checked::Valid(AlphaMode::Mask) if cutoff > 0.0 => {
            material.alpha_texture = material.base_color_texture;
            material.alpha = alpha.clamp(0.0, 1.0);
            material.alpha_mode = crate::AlphaMode::Mask { cutoff };
        }
        Checked::Valid(AlphaMode::Blend) => {
            material.alpha_texture = material.base_color_texture;
            material.alpha = alpha.clamp(0.0, 1.0);
            material.alpha_mode = crate::AlphaMode::Blend;
        }
        Checked::Valid(AlphaMode::Mask | AlphaMode::Opaque) | Checked::Invalid => {}
    }

    let strength = source.extensions.as_ref().and_then(|extensions| extensions.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
    let emission = source.emissive_factor.0.map(|x| x * strength);
    if emission.iter().all(|x| x.is_finite() && *x >= 0.0) {
        material.emission = emission;
    } else {
        scene.warnings.push(format!("{place}: emission {emission:?} is left out"));
    }
    if let Some(info) = source.emissive_texture.as_ref().filter(|_| material.emission != [0.0; 3]) {
        let mean = textures.mean(info.index.value(), &place, scene)?;
        material.emission = std::array::from_fn(|k| material.emission[k] * mean[k]);
    }
    Ok((material, uv_source))
}
