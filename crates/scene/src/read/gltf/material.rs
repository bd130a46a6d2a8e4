//! Metallic-roughness materials (glTF 2.0, section 3.9) with the extensions that [`Material`] supports. Further lobes are those of
//! `KHR_materials_clearcoat`, `_sheen`, `_anisotropy`, `_iridescence`, the colors of `_specular`, the absorption of `_volume`, and
//! `_pbrSpecularGlossiness`.

use gltf::json::deserialize::from_value;
use gltf::json::extensions::material::{Material as Extensions, Specular, Volume};
use gltf::json::material::{AlphaMode, PbrMetallicRoughness};
use gltf::json::mesh::Semantic;
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use gltf::json::{Material as Source, Value};

use super::document::{Document, SPECULAR_GLOSSINESS};
use super::texture::{TextureInfo, Textures};
use crate::read::error::{ReadError, WarningGroups};
use crate::{Encoding, Lobes, Material, Scene, TextureRef};

/// Reads all materials and their textures, followed by the default material if a primitive uses it.
pub(super) fn read(document: &Document<'_>, grouped: &mut WarningGroups, scene: &mut Scene) -> Result<(), ReadError> {
    let mut textures = Textures::new(document);
    let mut read = |location: String, source: &Source, scene: &mut Scene| {
        let mut reader = MaterialReader { location, textures: &mut textures, grouped, warnings: &mut scene.warnings };
        let material = reader.material(source)?;
        scene.materials.push(material);
        Ok(())
    };
    for (k, source) in document.root.materials.iter().enumerate() {
        read(format!("material {k}"), source, scene)?;
    }
    let mut primitives = document.root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if primitives.any(|primitive| primitive.material.is_none()) {
        read("default".to_owned(), &Source::default(), scene)?;
    }
    // Vertex colors do not affect emission.
    let has_vertex_colors = has_vertex_colors(document);
    for k in (0..has_vertex_colors.len()).filter(|&k| has_vertex_colors[k] && is_unlit(&document.root.materials[k])) {
        grouped.add("ignoring vertex colors with KHR_materials_unlit", &format!("material {k}"));
    }
    textures.load(scene)
}

/// Context for reading a material.
struct MaterialReader<'a, 'b, 'c> {
    /// `material 3`.
    location: String,
    textures: &'a mut Textures<'b, 'c>,
    grouped: &'a mut WarningGroups,
    warnings: &'a mut Vec<String>,
}

impl MaterialReader<'_, '_, '_> {
    fn material(&mut self, source: &Source) -> Result<Material, ReadError> {
        let name = source.name.clone().unwrap_or_else(|| self.location.clone());
        let pbr = &source.pbr_metallic_roughness;
        let [red, green, blue, alpha] = self.fractions("base color", pbr.base_color_factor.0);
        let mut material = Material {
            name,
            base_color: [red, green, blue],
            base_color_texture: self.texture(pbr.base_color_texture.as_ref(), Encoding::Srgb)?,
            double_sided: source.double_sided,
            ..Material::default()
        };
        self.alpha(source, alpha, &mut material);
        if material.is_invisible() {
            let location =
                source.name.as_ref().map_or_else(|| self.location.clone(), |name| format!("material {name:?}"));
            self.grouped.add("a fully transparent material is not seen", &location);
        }
        if is_unlit(source) {
            self.grouped.add("treating KHR_materials_unlit as emission, which illuminates the scene", &self.location);
            return Ok(unlit(material));
        }
        let others = source.extensions.as_ref().map(|extensions| &extensions.others);
        match others.and_then(|others| others.get(SPECULAR_GLOSSINESS)) {
            Some(other) => self.specular_glossiness(other, &mut material)?,
            None => self.scattering(pbr, &mut material)?,
        }
        self.normals(source, &mut material)?;
        self.emission(source, &mut material)?;
        if let Some(extensions) = &source.extensions {
            self.interface(extensions, &mut material)?;
        }
        if source.occlusion_texture.is_some() {
            self.grouped.add("ignoring occlusionTexture (not physical)", &self.location);
        }
        Ok(material)
    }

    /// Alpha mode; a mask with cutoff 0 is opaque.
    fn alpha(&mut self, source: &Source, alpha: f32, material: &mut Material) {
        if source.alpha_mode == Checked::Invalid {
            self.grouped.add("treating an unknown alphaMode as OPAQUE", &self.location);
        }
        let cutoff = source.alpha_cutoff.unwrap_or_default().0;
        material.alpha_mode = match source.alpha_mode {
            Checked::Valid(AlphaMode::Mask) if cutoff > 0.0 => crate::AlphaMode::Mask { cutoff },
            Checked::Valid(AlphaMode::Blend) => crate::AlphaMode::Blend,
            Checked::Valid(AlphaMode::Mask | AlphaMode::Opaque) | Checked::Invalid => return,
        };
        material.alpha = alpha;
        material.alpha_texture = material.base_color_texture;
    }

    fn scattering(&mut self, source: &PbrMetallicRoughness, material: &mut Material) -> Result<(), ReadError> {
        material.specular = 1.0;
        [material.metallic] = self.fractions("metallic factor", [source.metallic_factor.0]);
        [material.roughness] = self.fractions("roughness factor", [source.roughness_factor.0]);
        let texture = source.metallic_roughness_texture.as_ref();
        let is_used = material.metallic > 0.0 || material.roughness > 0.0;
        material.metallic_roughness_texture = self.texture(texture.filter(|_| is_used), Encoding::Linear)?;
        Ok(())
    }

    fn normals(&mut self, source: &Source, material: &mut Material) -> Result<(), ReadError> {
        let Some(source) = &source.normal_texture else { return Ok(()) };
        if !source.scale.is_finite() {
            self.warnings
                .push(format!("skipping normal texture of {}: scale {} is not finite", self.location, source.scale));
            return Ok(());
        }
        let info = TextureInfo::from_normal_texture(source, self.textures.document, &self.location)?;
        material.normal_texture = self.texture(Some(info), Encoding::Linear)?;
        material.normal_scale = source.scale;
        Ok(())
    }

    fn emission(&mut self, source: &Source, material: &mut Material) -> Result<(), ReadError> {
        let strength = source.extensions.as_ref().and_then(|extensions| extensions.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
        let emission = source.emissive_factor.0.map(|x| x * strength);
        if !emission.iter().all(|x| x.is_finite() && *x >= 0.0) {
            self.warnings
                .push(format!("ignoring emission of {}: {emission:?} must be finite and not negative", self.location));
            return Ok(());
        }
        material.emission = emission;
        let texture = source.emissive_texture.as_ref().filter(|_| emission != [0.0; 3]);
        material.emission_texture = self.texture(texture, Encoding::Srgb)?;
        Ok(())
    }

    /// Specular, ior, transmission, volume and further lobes.
    fn interface(&mut self, extensions: &Extensions, material: &mut Material) -> Result<(), ReadError> {
        if let Some(specular) = &extensions.specular {
            [material.specular] = self.fractions("specular factor", [specular.specular_factor.0]);
        }
        if let Some(ior) = extensions.ior.as_ref().map(|ior| ior.ior.0) {
            self.ior(ior, material);
        }
        if let Some(transmission) = &extensions.transmission {
            [material.transmission] = self.fractions("transmission factor", [transmission.transmission_factor.0]);
            let texture = transmission.transmission_texture.as_ref().filter(|_| material.transmission > 0.0);
            material.transmission_texture = self.texture(texture, Encoding::Linear)?;
        }
        let volume = extensions.volume.as_ref();
        let is_body = volume.is_some_and(|volume| volume.thickness_factor.0 > 0.0);
        material.thin_walled = material.transmission > 0.0 && !is_body;
        // The older model has no others beside it.
        if extensions.others.contains_key(SPECULAR_GLOSSINESS) { Ok(()) } else { self.lobes(extensions, material) }
    }

    /// 0 means total reflection (`KHR_materials_ior`), approximated by the largest index.
    fn ior(&mut self, ior: f32, material: &mut Material) {
        if ior == 0.0 || ior > Material::MAX_IOR {
            material.ior = Material::MAX_IOR;
        } else if ior >= 1.0 {
            material.ior = ior;
        } else {
            self.warnings.push(format!("ignoring ior {ior} of {}: less than 1", self.location));
        }
        if ior > Material::MAX_IOR {
            self.warnings.push(format!("clamping ior {ior} of {} to {}", self.location, material.ior));
        }
    }

    /// Factors clamped to 0..=1, with a warning.
    fn fractions<const N: usize>(&mut self, what: &str, factors: [f32; N]) -> [f32; N] {
        let clamped = factors.map(fraction);
        if clamped != factors {
            self.warnings.push(format!("clamping {what} {factors:?} of {} to 0..=1", self.location));
        }
        clamped
    }

    /// A texture of sRGB-encoded colors or of linear numbers.
    fn texture(
        &mut self,
        info: Option<impl Into<TextureInfo>>,
        encoding: Encoding,
    ) -> Result<Option<TextureRef>, ReadError> {
        self.texture_with(info.map(Into::into), encoding, None)
    }

    /// As [`Self::texture`]; with the bits of a factor it is of roughness, 1 minus the glossiness of the alpha channel times that.
    fn texture_with(
        &mut self,
        info: Option<TextureInfo>,
        encoding: Encoding,
        glossiness: Option<u32>,
    ) -> Result<Option<TextureRef>, ReadError> {
        let Some(info) = info else { return Ok(None) };
        let uv_set = match info.uv_set() {
            Ok(uv_set) => uv_set,
            Err(set) => {
                self.grouped.add(&format!("skipping textures with TEXCOORD_{set} (not supported)"), &self.location);
                return Ok(None);
            }
        };
        let Some(texture_from_mesh) = info.texture_from_mesh() else {
            self.warnings.push(format!("skipping a texture of {}: KHR_texture_transform is not finite", self.location));
            return Ok(None);
        };
        let texture = self.textures.request(info.texture, encoding, glossiness, &self.location, self.grouped)?;
        Ok(texture.map(|texture| TextureRef { texture, uv_set, texture_from_mesh }))
    }
}

fn is_unlit(source: &Source) -> bool {
    source.extensions.as_ref().is_some_and(|extensions| extensions.unlit.is_some())
}

/// For each material, whether a primitive that uses it has vertex colors.
fn has_vertex_colors(document: &Document<'_>) -> Vec<bool> {
    let colors = Checked::Valid(Semantic::Colors(0));
    let mut has_vertex_colors = vec![false; document.root.materials.len()];
    for primitive in document.root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        // Invalid indices are reported when primitives are read.
        let named = primitive.material.and_then(|material| has_vertex_colors.get_mut(material.value()));
        if let Some(slot) = named {
            *slot |= primitive.attributes.contains_key(&colors);
        }
    }
    has_vertex_colors
}

/// An unlit material: it emits its base color and reflects nothing.
fn unlit(material: Material) -> Material {
    Material {
        base_color: [0.0; 3],
        base_color_texture: None,
        emission: material.base_color,
        emission_texture: material.base_color_texture,
        ..material
    }
}

/// Extensions that [`MaterialReader::lobes`] reads.
const NAMES: [&str; 5] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    SPECULAR_GLOSSINESS,
];

impl MaterialReader<'_, '_, '_> {
    /// Adds the lobes of extensions to `material`, which has none where they have no effect.
    fn lobes(&mut self, extensions: &Extensions, material: &mut Material) -> Result<(), ReadError> {
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

    fn specular_color(&mut self, source: &Specular, lobes: &mut Lobes) -> Result<(), ReadError> {
        let color = source.specular_color_factor.0;
        if color.iter().all(|x| x.is_finite() && *x >= 0.0) {
            lobes.specular_color = color;
        } else {
            self.warnings.push(format!("ignoring the specular color {color:?} of {}", self.location));
        }
        lobes.specular_texture = self.texture(source.specular_texture.as_ref(), Encoding::Linear)?;
        lobes.specular_color_texture = self.texture(source.specular_color_texture.as_ref(), Encoding::Srgb)?;
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

    fn clearcoat(&mut self, source: &Value, lobes: &mut Lobes) -> Result<(), ReadError> {
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

    fn sheen(&mut self, source: &Value, lobes: &mut Lobes) -> Result<(), ReadError> {
        lobes.sheen_color = self.fractions("sheen color", numbers(source, "sheenColorFactor", [0.0; 3]));
        if lobes.sheen_color == [0.0; 3] {
            return Ok(());
        }
        [lobes.sheen_roughness] = self.fractions("sheen roughness", [number(source, "sheenRoughnessFactor", 0.0)]);
        lobes.sheen_color_texture = self.named(source, "sheenColorTexture", Encoding::Srgb)?;
        lobes.sheen_roughness_texture = self.named(source, "sheenRoughnessTexture", Encoding::Linear)?;
        Ok(())
    }

    fn anisotropy(&mut self, source: &Value, lobes: &mut Lobes) -> Result<(), ReadError> {
        [lobes.anisotropy] = self.fractions("anisotropy strength", [number(source, "anisotropyStrength", 0.0)]);
        if lobes.anisotropy == 0.0 {
            return Ok(());
        }
        let rotation = number(source, "anisotropyRotation", 0.0);
        lobes.anisotropy_rotation = if rotation.is_finite() { rotation } else { 0.0 };
        lobes.anisotropy_texture = self.named(source, "anisotropyTexture", Encoding::Linear)?;
        Ok(())
    }

    fn iridescence(&mut self, source: &Value, lobes: &mut Lobes) -> Result<(), ReadError> {
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
    fn specular_glossiness(&mut self, source: &Value, material: &mut Material) -> Result<(), ReadError> {
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
        let rough = self.texture_with(info, Encoding::Linear, Some(glossiness.to_bits()))?;
        material.roughness = if rough.is_some() { 1.0 } else { 1.0 - glossiness };
        material.metallic_roughness_texture = rough;
        material.lobes = Some(Box::new(Lobes { specular_color: color, specular_color_texture, ..Lobes::default() }));
        Ok(())
    }

    /// A texture that an extension names.
    fn named(&mut self, source: &Value, key: &str, encoding: Encoding) -> Result<Option<TextureRef>, ReadError> {
        let info = info(source, key, self)?;
        self.texture(info, encoding)
    }
}

/// The texture of an extension.
fn info(source: &Value, key: &str, reader: &MaterialReader<'_, '_, '_>) -> Result<Option<TextureInfo>, ReadError> {
    let Some(value) = source.get(key) else { return Ok(None) };
    let info: Info = from_value(value.clone())
        .map_err(|error| reader.textures.document.malformed(&reader.location, format!("invalid {key}: {error}")))?;
    Ok(Some(TextureInfo::from(&info)))
}

/// A number of an extension; NaN where it is none, which is clamped or refused by its reader.
fn number(source: &Value, key: &str, default: f32) -> f32 {
    source.get(key).map_or(default, |value| value.as_f64().map_or(f32::NAN, |x| x as f32))
}

/// Numbers of an extension.
fn numbers<const N: usize>(source: &Value, key: &str, default: [f32; N]) -> [f32; N] {
    let Some(value) = source.get(key) else { return default };
    std::array::from_fn(|k| value.get(k).and_then(Value::as_f64).map_or(f32::NAN, |x| x as f32))
}

/// `x` clamped to 0..=1; NaN becomes 0.
#[expect(clippy::manual_clamp, reason = "clamp keeps a NaN")]
pub(super) fn fraction(x: f32) -> f32 {
    x.max(0.0).min(1.0)
}
