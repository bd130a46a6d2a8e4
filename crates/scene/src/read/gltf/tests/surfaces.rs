//! Metal, normal maps, glass, emission and unsupported extensions.

use serde_json::{Value, json};

use super::materials::{file, textured};
use crate::{AlphaMode, Encoding, Material, TextureId, TextureRef, UvTransform};

/// The material read from a file.
pub(super) fn surface(material: Value) -> Material {
    file(material).scene().materials.remove(0)
}

#[test]
fn default_is_rough_metal() {
    let want = Material {
        name: "material 0".to_owned(),
        base_color: [1.0; 3],
        metallic: 1.0,
        roughness: 1.0,
        specular: 1.0,
        ..Material::default()
    };
    assert_eq!(surface(json!({})), want);
}

#[test]
fn reads_metallic_and_roughness() {
    let pbr = json!({ "metallicFactor": 0.25, "roughnessFactor": 0.5, "metallicRoughnessTexture": { "index": 0 } });
    let scene = file(json!({ "pbrMetallicRoughness": pbr })).scene();
    let material = &scene.materials[0];
    assert_eq!((material.metallic, material.roughness), (0.25, 0.5));
    assert_eq!(material.metallic_roughness_texture, Some(TextureRef::new(TextureId(0))));
    assert_eq!(scene.textures[0].encoding, Encoding::Linear);
    let scene = file(json!({ "pbrMetallicRoughness": { "roughnessFactor": 3 } })).warned("roughness factor");
    assert_eq!(scene.materials[0].roughness, 1.0);
    let smooth = json!({ "metallicFactor": 0, "roughnessFactor": 0, "metallicRoughnessTexture": { "index": 0 } });
    assert!(
        file(json!({ "pbrMetallicRoughness": smooth })).scene().textures.is_empty(),
        "factors of 0 need no texture"
    );
}

#[test]
fn color_and_data_use_of_an_image_are_two_textures() {
    let mut material = textured(json!({}));
    material["normalTexture"] = json!({ "index": 0, "scale": -0.5 });
    let scene = file(material).scene();
    assert_eq!(scene.materials[0].base_color_texture.unwrap().texture, TextureId(0));
    assert_eq!(scene.materials[0].normal_texture.unwrap().texture, TextureId(1));
    assert_eq!(scene.materials[0].normal_scale, -0.5);
    assert_eq!([0, 1].map(|k| scene.textures[k].encoding), [Encoding::Srgb, Encoding::Linear]);
    assert_eq!(scene.textures[0].texels, scene.textures[1].texels);
}

#[test]
fn normal_maps_are_transformed() {
    let moved = |transform: Value| {
        file(json!({ "normalTexture": { "index": 0, "extensions": { "KHR_texture_transform": transform } } }))
    };
    let scene = moved(json!({ "offset": [0.25, 0] })).scene();
    let rows = [[1.0, 0.0, 0.25], [0.0, 1.0, 0.0]];
    assert_eq!(scene.materials[0].normal_texture.unwrap().texture_from_mesh, UvTransform { rows });
    moved(json!({ "offset": 3 })).rejected("material 0: invalid KHR_texture_transform");
    file(json!({ "normalTexture": { "index": 0, "scale": 1e39 } })).warned("normal texture of material 0");
}

#[test]
fn reads_emission_texture() {
    let scene = file(json!({ "emissiveFactor": [2, 1, 0], "emissiveTexture": { "index": 0 } })).scene();
    assert_eq!(scene.materials[0].emission, [2.0, 1.0, 0.0]);
    assert_eq!(scene.materials[0].emission_texture, Some(TextureRef::new(TextureId(0))));
    assert_eq!(scene.textures[0].encoding, Encoding::Srgb);
    assert!(file(json!({ "emissiveTexture": { "index": 0 } })).scene().textures.is_empty(), "no emission");
}

#[test]
fn glass_without_thickness_is_thin_walled() {
    let with = |extensions: Value| surface(json!({ "extensions": extensions }));
    let transmission = json!({ "transmissionFactor": 0.75, "transmissionTexture": { "index": 0 } });
    let sheet = with(json!({ "KHR_materials_transmission": transmission, "KHR_materials_ior": { "ior": 1.25 } }));
    assert_eq!((sheet.transmission, sheet.ior, sheet.thin_walled), (0.75, 1.25, true));
    assert_eq!(sheet.transmission_texture, Some(TextureRef::new(TextureId(0))));
    for (thickness, thin_walled) in [(0.0, true), (0.5, false)] {
        let volume = json!({ "thicknessFactor": thickness });
        let glass = with(json!({ "KHR_materials_transmission": transmission, "KHR_materials_volume": volume }));
        assert_eq!(glass.thin_walled, thin_walled);
    }
    assert!(!with(json!({ "KHR_materials_volume": {} })).thin_walled, "opaque materials are not thin-walled");
    let with_ior = |ior: f64| file(json!({ "extensions": { "KHR_materials_ior": { "ior": ior } } }));
    for (ior, read) in [(0.0, Material::MAX_IOR), (1.0, 1.0), (1000.0, Material::MAX_IOR)] {
        assert_eq!(with_ior(ior).scene().materials[0].ior, read, "{ior}");
    }
    for (ior, what, read) in [
        (0.5, "ior 0.5 of material 0: less than 1", 1.5),
        (-1.0, "ior -1 of material 0: less than 1", 1.5),
        (1e20, "clamping ior 100000000000000000000 of material 0 to 1000", Material::MAX_IOR),
        (1e39, "clamping ior inf of material 0 to 1000", Material::MAX_IOR),
    ] {
        assert_eq!(with_ior(ior).warned(what).materials[0].ior, read, "{ior}");
    }
}

#[test]
fn reads_specular_extension() {
    let specular = |specular: Value| json!({ "extensions": { "KHR_materials_specular": specular } });
    assert_eq!(surface(specular(json!({ "specularFactor": 0.25 }))).specular, 0.25);
    assert_eq!(surface(specular(json!({}))).specular, 1.0);
    let red = surface(specular(json!({ "specularColorFactor": [2, 0, 0] })));
    assert_eq!(red.lobes.unwrap().specular_color, [2.0, 0.0, 0.0]);
    assert!(surface(specular(json!({ "specularTexture": { "index": 0 } }))).lobes.unwrap().specular_texture.is_some());
    file(specular(json!({ "specularColorFactor": [-1, 0, 0] }))).warned("ignoring the specular color");
}

#[test]
fn unlit_materials_become_emissive() {
    let mut material = textured(json!({}));
    material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.25, 1, 0.5]);
    material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({ "index": 0 });
    material["alphaMode"] = json!("BLEND");
    material["extensions"] = json!({ "KHR_materials_unlit": {} });
    let scene = file(material).warned("treating KHR_materials_unlit as emission");
    let texture = Some(TextureRef::new(TextureId(0)));
    let want = Material {
        name: "material 0".to_owned(),
        base_color: [0.0; 3],
        emission: [0.5, 0.25, 1.0],
        emission_texture: texture,
        alpha_mode: AlphaMode::Blend,
        alpha: 0.5,
        alpha_texture: texture,
        ..Material::default()
    };
    assert_eq!(scene.materials[0], want);
    assert_eq!(scene.textures.len(), 1);

    let mut colored = file(json!({ "extensions": { "KHR_materials_unlit": {} } }));
    let colors = colored.reals("VEC3", &[0.5; 9]);
    colored.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colors);
    let warnings = colored.read().unwrap().warnings;
    assert_eq!(warnings[1], "ignoring vertex colors with KHR_materials_unlit: material 0");
}

#[test]
fn unsupported_extensions_are_reported_once() {
    let dispersion = "KHR_materials_dispersion";
    let mut several = file(json!({ "extensions": { dispersion: {} }, "occlusionTexture": { "index": 0 } }));
    several.push("materials", json!({ "extensions": { dispersion: {}, "KHR_materials_unheard_of": {} } }));
    let scene = several.read().unwrap();
    assert_eq!(
        scene.warnings,
        [
            "ignoring KHR_materials_dispersion (not supported): material 0 and 1 more",
            "ignoring occlusionTexture (not physical): material 0",
            "ignoring KHR_materials_unheard_of (not supported): material 1",
        ]
    );
    assert!(scene.textures.is_empty());
}
