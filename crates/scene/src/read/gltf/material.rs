//! Metallic-roughness materials (glTF 2.0, section 3.9) with the extensions that [`Material`] supports.

use gltf::json::Material as Source;
use gltf::json::extensions::material::Material as Extensions;
use gltf::json::material::{AlphaMode, PbrMetallicRoughness};
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::attributes::fraction;
use super::document::Document;
use super::lobes::SPECULAR_GLOSSINESS;
use super::texture::Textures;
use super::texture_info::TextureInfo;
use crate::read::ReadError;
use crate::read::warning_groups::WarningGroups;
use crate::{Encoding, Material, Scene, TextureRef};

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
pub(super) struct MaterialReader<'a, 'b, 'c> {
    /// `material 3`.
    pub(super) location: String,
    pub(super) textures: &'a mut Textures<'b, 'c>,
    pub(super) grouped: &'a mut WarningGroups,
    pub(super) warnings: &'a mut Vec<String>,
}

impl MaterialReader<'_, '_, '_> {
    fn material(&mut self, source: &Source) -> Result<Material, ReadError> {
        let name = source.name.clone().unwrap_or_else(|| self.location.clone());
        let pbr = &source.pbr_metallic_roughness;
        let [red, green, blue, alpha] = self.fractions("base color", pbr.base_color_factor.0);
        let mut material = Material {
            name,
            base_color: [red, green, blue],
            base_color_texture: self.colors(pbr.base_color_texture.as_ref().map(TextureInfo::from))?,
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
        material.metallic_roughness_texture = self.numbers(texture.filter(|_| is_used).map(TextureInfo::from))?;
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
        material.normal_texture = self.numbers(Some(info))?;
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
        material.emission_texture = self.colors(texture.map(TextureInfo::from))?;
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
            material.transmission_texture = self.numbers(texture.map(TextureInfo::from))?;
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
    pub(super) fn fractions<const N: usize>(&mut self, what: &str, factors: [f32; N]) -> [f32; N] {
        let clamped = factors.map(fraction);
        if clamped != factors {
            self.warnings.push(format!("clamping {what} {factors:?} of {} to 0..=1", self.location));
        }
        clamped
    }

    pub(super) fn colors(&mut self, info: Option<TextureInfo>) -> Result<Option<TextureRef>, ReadError> {
        self.texture(info, Encoding::Srgb)
    }

    pub(super) fn numbers(&mut self, info: Option<TextureInfo>) -> Result<Option<TextureRef>, ReadError> {
        self.texture(info, Encoding::Linear)
    }

    /// A roughness texture, 1 minus the glossiness of the alpha channel times `factor`.
    pub(super) fn roughness_of(
        &mut self,
        info: Option<TextureInfo>,
        factor: f32,
    ) -> Result<Option<TextureRef>, ReadError> {
        self.texture_with(info, Encoding::Linear, Some(factor.to_bits()))
    }

    pub(super) fn texture(
        &mut self,
        info: Option<TextureInfo>,
        encoding: Encoding,
    ) -> Result<Option<TextureRef>, ReadError> {
        self.texture_with(info, encoding, None)
    }

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
