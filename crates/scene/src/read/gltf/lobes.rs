//! Further lobes: the extensions `KHR_materials_clearcoat`, `_sheen`, `_anisotropy`, `_iridescence`, the colors of `_specular`, the
//! absorption of `_volume`, and `_pbrSpecularGlossiness`.

use gltf::json::Value;
use gltf::json::deserialize::from_value;
use gltf::json::extensions::material::Material as Extensions;
use gltf::json::extensions::material::{Specular, Volume};
use gltf::json::texture::Info;

use super::material::MaterialReader;
use super::texture_info::TextureInfo;
use crate::read::ReadError;
use crate::{Encoding, Lobes, Material, TextureRef};

/// Name of the extension for diffuse and specular color.
pub(super) const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Extensions that [`MaterialReader::lobes`] reads.
const NAMES: [&str; 5] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    SPECULAR_GLOSSINESS,
];

type Result<T> = std::result::Result<T, ReadError>;

impl MaterialReader<'_, '_, '_> {
    /// Adds the lobes of extensions to `material`, which has none where they have no effect.
    pub(super) fn lobes(&mut self, extensions: &Extensions, material: &mut Material) -> Result<()> {
        let mut lobes = Lobes::default();
        if let Some(specular) = &extensions.specular {
            self.specular_color(specular, &mut lobes)?;
        }
        if let Some(volume) = extensions.volume.as_ref().filter(|volume| volume.thickness_factor.0 > 0.0) {
            self.absorption(volume, &mut lobes);
        }
        for (name, value) in &extensions.others {
            match &name[..] {
                "KHR_materials_clearcoat" => self.clearcoat(value, &mut lobes)?,
                "KHR_materials_sheen" => self.sheen(value, &mut lobes)?,
                "KHR_materials_anisotropy" => self.anisotropy(value, &mut lobes)?,
                "KHR_materials_iridescence" => self.iridescence(value, &mut lobes)?,
                _ => {}
            }
        }
        for name in extensions.others.keys().filter(|name| !NAMES.contains(&name.as_str())) {
            self.grouped.add(&format!("ignoring {name} (not supported)"), &self.location);
        }
        if lobes != Lobes::default() {
            material.lobes = Some(Box::new(lobes));
        }
        Ok(())
    }

    fn specular_color(&mut self, source: &Specular, lobes: &mut Lobes) -> Result<()> {
        let color = source.specular_color_factor.0;
        if color.iter().all(|x| x.is_finite() && *x >= 0.0) {
            lobes.specular_color = color;
        } else {
            self.warnings.push(format!("ignoring the specular color {color:?} of {}", self.location));
        }
        lobes.specular_texture = self.numbers(source.specular_texture.as_ref().map(TextureInfo::from))?;
        lobes.specular_color_texture = self.colors(source.specular_color_texture.as_ref().map(TextureInfo::from))?;
        Ok(())
    }

    /// Of light that travels the attenuation distance, the attenuation color is left.
    fn absorption(&mut self, source: &Volume, lobes: &mut Lobes) {
        /// Smallest part of the light that is left.
        const LEAST: f32 = 1e-6;
        let distance = source.attenuation_distance.0;
        if distance > 0.0 && distance.is_finite() {
            let color = self.fractions("attenuation color", source.attenuation_color.0);
            // No absorption is 0, not -0.
            let absorption = color.map(|c| 0.0 - c.max(LEAST).ln() / distance);
            if absorption.iter().all(|x| x.is_finite()) {
                lobes.absorption = absorption.map(|x| x.max(0.0));
            }
        }
    }

    fn clearcoat(&mut self, source: &Value, lobes: &mut Lobes) -> Result<()> {
        [lobes.clearcoat] = self.fractions("clearcoat factor", [number(source, "clearcoatFactor", 0.0)]);
        if lobes.clearcoat == 0.0 {
            return Ok(());
        }
        let roughness = number(source, "clearcoatRoughnessFactor", 0.0);
        [lobes.clearcoat_roughness] = self.fractions("clearcoat roughness", [roughness]);
        lobes.clearcoat_texture = self.named(source, "clearcoatTexture", Encoding::Linear)?;
        lobes.clearcoat_roughness_texture = self.named(source, "clearcoatRoughnessTexture", Encoding::Linear)?;
        if source.get("clearcoatNormalTexture").is_some() {
            self.grouped.add("ignoring clearcoatNormalTexture (the coat has the normals of its base)", &self.location);
        }
        Ok(())
    }

    fn sheen(&mut self, source: &Value, lobes: &mut Lobes) -> Result<()> {
        lobes.sheen_color = self.fractions("sheen color", numbers(source, "sheenColorFactor", [0.0; 3]));
        if lobes.sheen_color == [0.0; 3] {
            return Ok(());
        }
        [lobes.sheen_roughness] = self.fractions("sheen roughness", [number(source, "sheenRoughnessFactor", 0.0)]);
        lobes.sheen_color_texture = self.named(source, "sheenColorTexture", Encoding::Srgb)?;
        lobes.sheen_roughness_texture = self.named(source, "sheenRoughnessTexture", Encoding::Linear)?;
        Ok(())
    }

    fn anisotropy(&mut self, source: &Value, lobes: &mut Lobes) -> Result<()> {
        [lobes.anisotropy] = self.fractions("anisotropy strength", [number(source, "anisotropyStrength", 0.0)]);
        if lobes.anisotropy == 0.0 {
            return Ok(());
        }
        let rotation = number(source, "anisotropyRotation", 0.0);
        lobes.anisotropy_rotation = if rotation.is_finite() { rotation } else { 0.0 };
        lobes.anisotropy_texture = self.named(source, "anisotropyTexture", Encoding::Linear)?;
        Ok(())
    }

    fn iridescence(&mut self, source: &Value, lobes: &mut Lobes) -> Result<()> {
        let factor = number(source, "iridescenceFactor", 0.0);
        if factor == 0.0 {
            return Ok(());
        }
        [lobes.iridescence] = self.fractions("iridescence factor", [factor]);
        let ior = number(source, "iridescenceIor", 1.3);
        let thickness = [("Minimum", 100.0), ("Maximum", 400.0)]
            .map(|(which, x)| number(source, &format!("iridescenceThickness{which}"), x));
        if !(1.0..=Material::MAX_IOR).contains(&ior) || !thickness.iter().all(|x| x.is_finite() && *x >= 0.0) {
            self.warnings.push(format!("ignoring the film of {}: ior {ior}, thickness {thickness:?}", self.location));
            lobes.iridescence = 0.0;
            return Ok(());
        }
        (lobes.iridescence_ior, lobes.iridescence_thickness) = (ior, thickness);
        lobes.iridescence_texture = self.named(source, "iridescenceTexture", Encoding::Linear)?;
        lobes.iridescence_thickness_texture = self.named(source, "iridescenceThicknessTexture", Encoding::Linear)?;
        Ok(())
    }

    /// Diffuse and specular color instead of base color and metallic: a dielectric of this reflectance at normal incidence.
    pub(super) fn specular_glossiness(&mut self, source: &Value, material: &mut Material) -> Result<()> {
        let [red, green, blue, alpha] = self.fractions("diffuse factor", numbers(source, "diffuseFactor", [1.0; 4]));
        material.base_color = [red, green, blue];
        material.base_color_texture = self.named(source, "diffuseTexture", Encoding::Srgb)?;
        if material.uses_alpha() {
            (material.alpha, material.alpha_texture) = (alpha, material.base_color_texture);
        }
        let [glossiness] = self.fractions("glossiness factor", [number(source, "glossinessFactor", 1.0)]);
        // The index of refraction reflects everything, which the color takes back.
        (material.metallic, material.specular, material.ior) = (0.0, 1.0, Material::MAX_IOR);
        let color = self.fractions("specular factor", numbers(source, "specularFactor", [1.0; 3]));
        let info = info(source, "specularGlossinessTexture", self)?;
        let specular_color_texture = self.texture(info.clone(), Encoding::Srgb)?;
        let rough = self.roughness_of(info, glossiness)?;
        material.roughness = if rough.is_some() { 1.0 } else { 1.0 - glossiness };
        material.metallic_roughness_texture = rough;
        material.lobes = Some(Box::new(Lobes { specular_color: color, specular_color_texture, ..Lobes::default() }));
        Ok(())
    }

    /// A texture that an extension names.
    fn named(&mut self, source: &Value, key: &str, encoding: Encoding) -> Result<Option<TextureRef>> {
        let info = info(source, key, self)?;
        self.texture(info, encoding)
    }
}

/// The texture of an extension.
fn info(source: &Value, key: &str, reader: &MaterialReader<'_, '_, '_>) -> Result<Option<TextureInfo>> {
    let Some(value) = source.get(key) else { return Ok(None) };
    let info: Info = from_value(value.clone())
        .map_err(|error| reader.textures.document.malformed(&reader.location, format!("invalid {key}: {error}")))?;
    Ok(Some(TextureInfo::from(&info)))
}

/// A number of an extension; NaN where it is none, which is clamped or refused by its reader.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn number(source: &Value, key: &str, default: f32) -> f32 {
    source.get(key).map_or(default, |value| value.as_f64().map_or(f32::NAN, |x| x as f32))
}

/// Numbers of an extension.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn numbers<const N: usize>(source: &Value, key: &str, default: [f32; N]) -> [f32; N] {
    let Some(value) = source.get(key) else { return default };
    std::array::from_fn(|k| value.get(k).and_then(Value::as_f64).map_or(f32::NAN, |x| x as f32))
}
