//! Materials: metallic-roughness (glTF 2.0, section 3.9) with the extensions that [`Material`] can say.

use gltf::json::Material as Source;
use gltf::json::extensions::material::Material as Extensions;
use gltf::json::material::{AlphaMode, PbrMetallicRoughness};
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::attributes::fraction;
use super::document::Document;
use super::lookup::Lookup;
use super::texture::Textures;
use crate::read::ReadError;
use crate::read::remarks::Remarks;
use crate::{Encoding, Material, Scene, TextureRef};

/// Reads all materials, and behind them the default one if a primitive needs it, with their textures.
pub(super) fn read(document: &Document<'_>, remarks: &mut Remarks, scene: &mut Scene) -> Result<(), ReadError> {
    let mut textures = Textures::new(document);
    let mut read = |place: String, source: &Source, scene: &mut Scene| {
        let mut reading = Reading { place, textures: &mut textures, remarks, warnings: &mut scene.warnings };
        let material = reading.material(source)?;
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
    // Emission has no colour of vertices.
    let tinted = tinted(document);
    for k in (0..tinted.len()).filter(|&k| tinted[k] && is_unlit(&document.root.materials[k])) {
        remarks.note("vertex colours of KHR_materials_unlit are ignored", &format!("material {k}"));
    }
    textures.load(scene)
}

/// What a material is read with.
struct Reading<'a, 'b, 'c> {
    /// `material 3`.
    place: String,
    textures: &'a mut Textures<'b, 'c>,
    remarks: &'a mut Remarks,
    warnings: &'a mut Vec<String>,
}

impl Reading<'_, '_, '_> {
    fn material(&mut self, source: &Source) -> Result<Material, ReadError> {
        let name = source.name.clone().unwrap_or_else(|| self.place.clone());
        let pbr = &source.pbr_metallic_roughness;
        let [red, green, blue, alpha] = self.fractions("base colour", pbr.base_color_factor.0);
        let mut material = Material {
            name,
            base_color: [red, green, blue],
            base_color_texture: self.colors(pbr.base_color_texture.as_ref().map(Lookup::from))?,
            ..Material::default()
        };
        self.alpha(source, alpha, &mut material);
        if is_unlit(source) {
            self.remarks.note("KHR_materials_unlit becomes emission, which lights the scene", &self.place);
            return Ok(unlit(material));
        }
        self.scattering(pbr, &mut material)?;
        self.normals(source, &mut material)?;
        self.emission(source, &mut material)?;
        if let Some(extensions) = &source.extensions {
            self.interface(extensions, &mut material)?;
        }
        if source.occlusion_texture.is_some() {
            self.remarks.note("occlusionTexture is ignored, as light is traced", &self.place);
        }
        Ok(material)
    }

    /// Alpha counts only where the mode says so. A mask that cuts nothing out is none.
    fn alpha(&mut self, source: &Source, alpha: f32, material: &mut Material) {
        if source.alpha_mode == Checked::Invalid {
            self.remarks.note("an alphaMode other than OPAQUE, MASK and BLEND is taken as OPAQUE", &self.place);
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
        material.metallic_roughness_texture = self.numbers(texture.filter(|_| is_used).map(Lookup::from))?;
        Ok(())
    }

    fn normals(&mut self, source: &Source, material: &mut Material) -> Result<(), ReadError> {
        let Some(source) = &source.normal_texture else { return Ok(()) };
        if !source.scale.is_finite() {
            self.warnings.push(format!("{}: normal scale {} is left out, with its texture", self.place, source.scale));
            return Ok(());
        }
        let lookup = Lookup::of_normals(source, self.textures.document, &self.place)?;
        material.normal_texture = self.numbers(Some(lookup))?;
        material.normal_scale = source.scale;
        Ok(())
    }

    fn emission(&mut self, source: &Source, material: &mut Material) -> Result<(), ReadError> {
        let strength = source.extensions.as_ref().and_then(|extensions| extensions.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
        let emission = source.emissive_factor.0.map(|x| x * strength);
        if !emission.iter().all(|x| x.is_finite() && *x >= 0.0) {
            self.warnings.push(format!("{}: emission {emission:?} is left out", self.place));
            return Ok(());
        }
        material.emission = emission;
        let texture = source.emissive_texture.as_ref().filter(|_| emission != [0.0; 3]);
        material.emission_texture = self.colors(texture.map(Lookup::from))?;
        Ok(())
    }

    /// Specular, ior, transmission and what remains of volumes: whether there is one.
    fn interface(&mut self, extensions: &Extensions, material: &mut Material) -> Result<(), ReadError> {
        if let Some(specular) = &extensions.specular {
            [material.specular] = self.fractions("specular factor", [specular.specular_factor.0]);
            if specular.specular_texture.is_some() || specular.specular_color_texture.is_some() {
                self.remarks.note("the textures of KHR_materials_specular are ignored", &self.place);
            }
            if specular.specular_color_factor.0 != [1.0; 3] {
                self.remarks.note("the colour of KHR_materials_specular is ignored", &self.place);
            }
        }
        if let Some(ior) = extensions.ior.as_ref().map(|ior| ior.ior.0) {
            self.ior(ior, material);
        }
        if let Some(transmission) = &extensions.transmission {
            [material.transmission] = self.fractions("transmission factor", [transmission.transmission_factor.0]);
            let texture = transmission.transmission_texture.as_ref().filter(|_| material.transmission > 0.0);
            material.transmission_texture = self.numbers(texture.map(Lookup::from))?;
        }
        let volume = extensions.volume.as_ref();
        let is_body = volume.is_some_and(|volume| volume.thickness_factor.0 > 0.0);
        material.thin_walled = material.transmission > 0.0 && !is_body;
        if is_body && volume.is_some_and(|volume| volume.attenuation_distance.0.is_finite()) {
            self.remarks.note("the attenuation of KHR_materials_volume is ignored", &self.place);
        }
        for name in extensions.others.keys() {
            self.remarks.note(&format!("{name} is ignored"), &self.place);
        }
        Ok(())
    }

    /// 0 stands for a boundary that reflects all (`KHR_materials_ior`), which the greatest index nearly does.
    fn ior(&mut self, ior: f32, material: &mut Material) {
        if ior == 0.0 || ior > Material::MAX_IOR {
            material.ior = Material::MAX_IOR;
        } else if ior >= 1.0 {
            material.ior = ior;
        } else {
            self.warnings.push(format!("{}: ior {ior} is below 1 and left at {}", self.place, material.ior));
        }
        if ior > Material::MAX_IOR {
            self.warnings.push(format!("{}: ior {ior} is clamped to {}", self.place, material.ior));
        }
    }

    /// Factors clamped to 0..=1, which is said where it changes them.
    fn fractions<const N: usize>(&mut self, what: &str, factors: [f32; N]) -> [f32; N] {
        let clamped = factors.map(fraction);
        if clamped != factors {
            self.warnings.push(format!("{}: {what} {factors:?} is clamped to 0..=1", self.place));
        }
        clamped
    }

    fn colors(&mut self, lookup: Option<Lookup>) -> Result<Option<TextureRef>, ReadError> {
        self.texture(lookup, Encoding::Srgb)
    }

    fn numbers(&mut self, lookup: Option<Lookup>) -> Result<Option<TextureRef>, ReadError> {
        self.texture(lookup, Encoding::Linear)
    }

    fn texture(&mut self, lookup: Option<Lookup>, encoding: Encoding) -> Result<Option<TextureRef>, ReadError> {
        let Some(lookup) = lookup else { return Ok(None) };
        let uv_set = match lookup.uv_set() {
            Ok(uv_set) => uv_set,
            Err(set) => {
                self.remarks.note(&format!("TEXCOORD_{set} is not read, its textures are left out"), &self.place);
                return Ok(None);
            }
        };
        let Some(texture_from_mesh) = lookup.texture_from_mesh() else {
            self.warnings
                .push(format!("{}: a KHR_texture_transform is not finite, its texture is left out", self.place));
            return Ok(None);
        };
        let texture = self.textures.request(lookup.texture, encoding, &self.place, self.remarks)?;
        Ok(texture.map(|texture| TextureRef { texture, uv_set, texture_from_mesh }))
    }
}

fn is_unlit(source: &Source) -> bool {
    source.extensions.as_ref().is_some_and(|extensions| extensions.unlit.is_some())
}

/// Whether each material has a primitive with colours at its vertices.
fn tinted(document: &Document<'_>) -> Vec<bool> {
    let colors = Checked::Valid(Semantic::Colors(0));
    let mut tinted = vec![false; document.root.materials.len()];
    for primitive in document.root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        // Who names a material that is not there is told so where primitives are read.
        let named = primitive.material.and_then(|material| tinted.get_mut(material.value()));
        if let Some(is_tinted) = named {
            *is_tinted |= primitive.attributes.contains_key(&colors);
        }
    }
    tinted
}

/// A surface that shows its colour in any light: it emits it, and reflects nothing.
fn unlit(material: Material) -> Material {
    Material {
        base_color: [0.0; 3],
        base_color_texture: None,
        emission: material.base_color,
        emission_texture: material.base_color_texture,
        ..material
    }
}
