//! Materials and textures: factors, masks, wrap modes, coordinates, transforms, unreadable images; metal, normal maps, glass, emission,
//! further lobes, variants and unsupported extensions.

use canted_scene::{
    AlphaMode, Encoding, Magnification, Material, ReadError, ReadOptions, Scene, TextureId, TextureRef, UvSet,
    UvTransform, Wrap,
};
use serde_json::{Value, json};

use super::{File, TRIANGLE};

/// A 2 x 1 PNG: opaque red, transparent gray.
pub(super) fn png() -> Vec<u8> {
    let image = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([[255, 0, 0, 255], [128, 128, 128, 0]][x as usize]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Texture coordinates of set 0; set 1 has them reversed.
const UVS: [f32; 6] = [0.0, 0.0, 0.5, 0.25, 1.0, 1.0];

/// The triangle with two sets of coordinates, the given material, and the PNG as image 0.
pub(super) fn file(material: Value) -> File {
    let mut file = File::new();
    let positions = file.reals("VEC3", &TRIANGLE);
    let uvs = file.reals("VEC2", &UVS);
    let reversed: Vec<f32> = UVS.chunks(2).rev().flatten().copied().collect();
    let uvs_1 = file.reals("VEC2", &reversed);
    let view = file.view(&png());
    file.push("images", json!({ "bufferView": view, "mimeType": "image/png", "name": "two texels" }));
    file.push("textures", json!({ "source": 0 }));
    file.push("materials", material);
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs, "TEXCOORD_1": uvs_1 });
    file.with_node(json!([{ "attributes": attributes, "material": 0 }]))
}

/// A material with texture 0 as base color texture.
fn textured(info: Value) -> Value {
    let mut info = info;
    info["index"] = json!(0);
    json!({ "pbrMetallicRoughness": { "baseColorTexture": info } })
}

fn uvs(scene: &Scene) -> &[[f32; 2]] {
    scene.meshes[0].uvs.as_deref().unwrap()
}

#[test]
fn reads_factors() {
    let scene = file(json!({
        "name": "lamp",
        "pbrMetallicRoughness": { "baseColorFactor": [0.25, 0.5, 0.75, 1] },
        "emissiveFactor": [1, 0.5, 0],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8 } },
    }))
    .scene();
    let material = &scene.materials[0];
    assert_eq!(
        (&material.name[..], material.base_color, material.emission),
        ("lamp", [0.25, 0.5, 0.75], [8.0, 4.0, 0.0])
    );
    assert!(scene.meshes[0].uvs.is_none() && scene.textures.is_empty(), "unused data is dropped");
    let scene = file(json!({})).scene();
    assert_eq!((&scene.materials[0].name[..], scene.materials[0].base_color), ("material 0", [1.0; 3]));
    let scene = file(json!({ "pbrMetallicRoughness": { "baseColorFactor": [2, -1, 0.5, 1] } })).warned("base color");
    assert_eq!(scene.materials[0].base_color, [1.0, 0.0, 0.5]);
    let scene = file(json!({ "emissiveFactor": [-1, 0, 0] })).warned("emission");
    assert_eq!(scene.materials[0].emission, [0.0; 3]);
}

#[test]
fn reads_texels_and_coordinates() {
    let scene = file(textured(json!({}))).scene();
    assert_eq!(scene.materials[0].base_color_texture, Some(TextureRef::new(TextureId(0))));
    assert_eq!(scene.materials[0].alpha_texture, None);
    let texture = &scene.textures[0];
    assert_eq!((&texture.name[..], texture.width, texture.height), ("two texels", 2, 1));
    assert_eq!(texture.texels, [[255, 0, 0, 255], [128, 128, 128, 0]]);
    assert_eq!(uvs(&scene), [[0.0, 1.0], [0.5, 0.75], [1.0, 0.0]], "v points up");
    assert!(scene.meshes[0].second_uvs.is_none(), "unused data is dropped");
    let scene = file(textured(json!({ "texCoord": 1 }))).scene();
    assert_eq!(scene.materials[0].base_color_texture.unwrap().uv_set, UvSet::Second);
    assert_eq!(scene.meshes[0].second_uvs.as_ref().unwrap()[0], [1.0, 0.0]);
    assert!(scene.meshes[0].uvs.is_none());
}

/// Texture lookup positions at the corners of the triangle.
fn lookups(scene: &Scene) -> Vec<[f64; 2]> {
    let texture = scene.materials[0].base_color_texture.unwrap();
    let uvs = scene.meshes[0].uv_set(texture.uv_set).unwrap();
    uvs.iter().map(|uv| texture.texture_from_mesh.point(uv.map(f64::from))).collect()
}

#[test]
fn applies_texture_transforms() {
    let with = |transform: Value| {
        let info = json!({ "extensions": { "KHR_texture_transform": transform } });
        lookups(&file(textured(info)).scene())
    };
    assert_eq!(with(json!({})), [[0.0, 1.0], [0.5, 0.75], [1.0, 0.0]]);
    assert_eq!(with(json!({ "scale": [2, 4], "offset": [0.5, 0.25] }))[1], [1.5, 1.0 - 1.25]);
    assert_eq!(with(json!({ "texCoord": 1 }))[0], [1.0, 0.0], "texCoord overrides the set");
    // The example of the extension: the lower left quadrant of the image, rotated.
    let rotated = with(json!({ "offset": [0, 1], "rotation": std::f32::consts::FRAC_PI_2, "scale": [0.5, 0.5] }));
    // Each matrix entry is rounded once and is less than 1.
    let rounding = 1.5 * f64::from(f32::EPSILON);
    for ([u, v], want) in rotated.into_iter().zip([[0.0, 0.0], [0.125, 0.25], [0.5, 0.5]]) {
        assert!((u - want[0]).abs() <= rounding && (v - want[1]).abs() <= rounding, "{u} {v} for {want:?}");
    }
    let infinite = textured(json!({ "extensions": { "KHR_texture_transform": { "scale": [1e39, 1] } } }));
    assert!(file(infinite).warned("not finite").textures.is_empty());
}

#[test]
fn reads_alpha_modes() {
    let with = |alpha: f32, mode: Value| {
        let mut material = textured(json!({}));
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 1, 1, alpha]);
        material.as_object_mut().unwrap().extend(mode.as_object().unwrap().clone());
        let material = file(material).scene().materials.remove(0);
        assert_eq!(
            material.alpha_texture.map(|texture| texture.texture),
            material.uses_alpha().then_some(TextureId(0))
        );
        (material.alpha_mode, material.alpha)
    };
    let mask = |cutoff| AlphaMode::Mask { cutoff };
    assert_eq!(with(1.0, json!({ "alphaMode": "MASK" })), (mask(0.5), 1.0));
    assert_eq!(with(0.5, json!({ "alphaMode": "MASK", "alphaCutoff": 0.25 })), (mask(0.25), 0.5));
    assert_eq!(with(1.0, json!({ "alphaMode": "MASK", "alphaCutoff": 0 })).0, AlphaMode::Opaque, "fully visible");
    assert_eq!(with(0.25, json!({ "alphaMode": "BLEND" })), (AlphaMode::Blend, 0.25));
    assert_eq!(with(1.0, json!({ "alphaMode": "OPAQUE" })).0, AlphaMode::Opaque);
    let mut unknown = file(json!({ "alphaMode": "ADD" }));
    unknown.push("materials", json!({ "alphaMode": "blend" }));
    let warning = "treating an unknown alphaMode as OPAQUE: material 0 and 1 more";
    assert_eq!(unknown.warned(warning).materials[0].alpha_mode, AlphaMode::Opaque);
}

#[test]
fn textures_with_equal_image_and_wrap_are_shared() {
    let mut file = file(textured(json!({})));
    file.push("samplers", json!({ "wrapS": 33071, "wrapT": 33648 }));
    file.push("textures", json!({ "source": 0 }));
    file.push("textures", json!({ "source": 0, "sampler": 0 }));
    for texture in [1, 2] {
        file.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } }));
    }
    let scene = file.scene();
    let ids: Vec<_> = scene.materials.iter().map(|material| material.base_color_texture.unwrap().texture.0).collect();
    assert_eq!(ids, [0, 0, 1]);
    assert_eq!(scene.textures[0].wrap, [Wrap::Repeat; 2]);
    assert_eq!(scene.textures[1].wrap, [Wrap::Clamp, Wrap::Mirror]);
}

#[test]
fn nearest_filters_are_read() {
    let with = |sampler: Value| {
        let mut file = file(textured(json!({})));
        file.push("samplers", sampler);
        file.json["textures"][0]["sampler"] = json!(0);
        file.push("textures", json!({ "source": 0, "sampler": 0 }));
        file.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } } }));
        file
    };
    for (sampler, want) in [
        (json!({ "magFilter": 9729, "minFilter": 9984 }), Magnification::Linear),
        (json!({ "magFilter": 9728, "minFilter": 9987 }), Magnification::Nearest),
        (json!({ "minFilter": 9984 }), Magnification::Nearest),
        (json!({}), Magnification::Linear),
    ] {
        let scene = with(sampler).scene();
        assert!(scene.textures.iter().all(|texture| texture.magnification == want), "{want:?}");
    }
}

#[test]
fn unreadable_images_are_skipped() {
    let with = |image: Value| {
        let mut file = file(textured(json!({})));
        file.json["images"][0] = image;
        let scene = file.warned("image 0");
        assert!(scene.materials[0].base_color_texture.is_none() && scene.meshes[0].uvs.is_none());
    };
    with(json!({ "bufferView": 0 }));
    with(json!({ "uri": "absent.png" }));
    with(json!({ "uri": "../escape.png" }));
    with(json!({ "uri": "http://example.invalid/a.png" }));
    with(json!({ "uri": "data:image/png;base64,AAAA" }));
    with(json!({}));

    let mut named = file(textured(json!({})));
    named.json["images"][0] = json!({ "name": "C:\\x\\q.png", "uri": "C%1b.png" });
    let scene = named.warned("image 0 'C:\\x\\q.png' of material 0: 'C\\u{1b}.png': ");
    assert!(!scene.warnings[0].contains(char::is_control));
}

#[test]
fn unsupported_image_formats_are_reported() {
    for name in ["MSFT_texture_dds", "EXT_texture_avif"] {
        let mut file = file(textured(json!({})));
        file.json["textures"][0] = json!({ "extensions": { name: { "source": 0 } } });
        file.json["extensionsUsed"] = json!([name]);
        file.json["extensionsRequired"] = json!([name]);
        file.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.25, 0, 1]);
        file.push("materials", file.json["materials"][0].clone());
        let scene = file.warned(&format!("skipping a texture whose image needs {name} (not supported)"));
        assert!(scene.warnings[0].ends_with(": material 0 and 1 more"), "{:?}", scene.warnings);
        assert_eq!((scene.materials[0].base_color, scene.materials[0].base_color_texture), ([0.5, 0.25, 0.0], None));
        assert!(scene.textures.is_empty() && scene.meshes[0].uvs.is_none());
        // A supported image is used if present.
        file.json["textures"][0]["source"] = json!(0);
        assert_eq!(file.scene().textures.len(), 1);
    }
    let mut file = file(textured(json!({})));
    file.json["textures"][0] = json!({});
    file.warned("skipping a texture without an image");
}

#[test]
fn out_of_range_indices_are_rejected() {
    let with = |list: &str, key: &str, value: Value| {
        let mut file = file(textured(json!({})));
        file.json[list][0][key] = value;
        file
    };
    with("materials", "pbrMetallicRoughness", json!({ "baseColorTexture": { "index": 1 } }))
        .rejected("material 0: texture index 1 out of range");
    with("textures", "source", json!(1)).rejected("texture 0: image index 1 out of range");
    with("textures", "sampler", json!(0)).rejected("texture 0: sampler index 0 out of range");
    with("images", "bufferView", json!(99)).rejected("image 0: buffer view index 99");
}

#[test]
fn missing_texture_coordinates_are_reported() {
    let mut file = file(textured(json!({ "texCoord": 1 })));
    let attributes = file.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
    attributes.remove("TEXCOORD_1");
    let scene = file.warned("TEXCOORD_1");
    assert_eq!(lookups(&scene), [[0.0, 1.0]; 3]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(0);
    file.rejected("accessor 0: expected type Vec2");
    file.json["materials"][0] = textured(json!({ "texCoord": 3 }));
    assert!(file.warned("TEXCOORD_3 (not supported)").textures.is_empty());
}

/// The material read from a file.
fn surface(material: Value) -> Material {
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
        double_sided: false,
        ..Material::default()
    };
    assert_eq!(surface(json!({})), want);
}

/// glTF 2.0, section 3.9.6: materials are single-sided unless they say otherwise; other formats have no such property.
#[test]
fn reads_sides() {
    for (material, double_sided) in [
        (json!({}), false),
        (json!({ "doubleSided": false }), false),
        (json!({ "doubleSided": true }), true),
        (json!({ "doubleSided": true, "extensions": { "KHR_materials_unlit": {} } }), true),
        (json!({ "extensions": { "KHR_materials_unlit": {} } }), false),
    ] {
        assert_eq!(file(material.clone()).read().unwrap().materials[0].double_sided, double_sided, "{material}");
    }
    assert!(Material::default().double_sided);
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
        double_sided: false,
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

/// What the extensions of lobes give; textures have the encoding of their use.
#[test]
fn reads_lobes() {
    let lobes = |name: &str, value: Value| surface(json!({ "extensions": { name: value } })).lobes;
    let texture = json!({ "index": 0 });
    let coat = lobes(
        "KHR_materials_clearcoat",
        json!({ "clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25, "clearcoatTexture": texture }),
    );
    let coat = coat.unwrap();
    assert_eq!((coat.clearcoat, coat.clearcoat_roughness), (0.5, 0.25));
    assert_eq!(coat.clearcoat_texture, Some(TextureRef::new(TextureId(0))));
    let sheen = lobes("KHR_materials_sheen", json!({ "sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": 0.5 }));
    assert_eq!(sheen.map(|s| (s.sheen_color, s.sheen_roughness)), Some(([1.0, 0.5, 0.0], 0.5)));
    let along = lobes("KHR_materials_anisotropy", json!({ "anisotropyStrength": 0.5, "anisotropyRotation": 1 }));
    assert_eq!(along.map(|a| (a.anisotropy, a.anisotropy_rotation)), Some((0.5, 1.0)));
    let film =
        lobes("KHR_materials_iridescence", json!({ "iridescenceFactor": 1, "iridescenceThicknessMaximum": 500 }));
    assert_eq!(
        film.map(|f| (f.iridescence, f.iridescence_ior, f.iridescence_thickness)),
        Some((1.0, 1.3, [100.0, 500.0]))
    );
    let solid = json!({ "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.25] });
    let [r, g, b] = lobes("KHR_materials_volume", solid).unwrap().absorption;
    let half = 0.5 * 2.0_f32.ln();
    assert_eq!(r, 0.0);
    assert!((g - half).abs() < 1e-6 && (b - 2.0 * half).abs() < 1e-6, "{g} {b}");
    for name in ["clearcoat", "sheen", "anisotropy", "iridescence", "specular", "volume"] {
        assert_eq!(lobes(&format!("KHR_materials_{name}"), json!({})), None, "{name}");
    }
    let coat = |value: Value| file(json!({ "extensions": { "KHR_materials_clearcoat": value } }));
    coat(json!({ "clearcoatFactor": 7 })).warned("clamping clearcoat factor [7.0] of material 0");
    coat(json!({ "clearcoatFactor": "1" })).warned("clamping clearcoat factor [NaN] of material 0");
    coat(json!({ "clearcoatFactor": 1, "clearcoatTexture": 0 })).rejected("material 0: invalid clearcoatTexture");
}

/// Roughness is made from the alpha channel of the texture.
#[test]
fn reads_specular_and_glossiness() {
    let name = "KHR_materials_pbrSpecularGlossiness";
    let factors =
        json!({ "diffuseFactor": [0.5, 0.25, 0, 1], "specularFactor": [0.5, 0.5, 1], "glossinessFactor": 0.75 });
    let plain = surface(json!({ "extensions": { name: factors } }));
    assert_eq!((plain.base_color, plain.metallic, plain.roughness), ([0.5, 0.25, 0.0], 0.0, 0.25));
    assert_eq!((plain.specular, plain.ior), (1.0, Material::MAX_IOR));
    assert_eq!(plain.lobes.unwrap().specular_color, [0.5, 0.5, 1.0]);
    let textured = file(json!({ "extensions": { name: { "specularGlossinessTexture": { "index": 0 } } } })).scene();
    let material = &textured.materials[0];
    let color = material.lobes.as_ref().unwrap().specular_color_texture.unwrap();
    let rough = material.metallic_roughness_texture.unwrap();
    assert_eq!(textured.textures[color.texture.0 as usize].encoding, Encoding::Srgb);
    let [colors, roughness] = [color, rough].map(|slot| &textured.textures[slot.texture.0 as usize].texels);
    for (color, rough) in colors.iter().zip(roughness) {
        assert_eq!(rough[1], 255 - color[3]);
    }
}

#[test]
fn variants_choose_materials() {
    let name = "KHR_materials_variants";
    let mut file = file(json!({ "name": "plain" }));
    file.push("materials", json!({ "name": "red" }));
    file.json["extensions"] = json!({ name: { "variants": [{ "name": "day" }, { "name": "night" }] } });
    file.json["extensionsUsed"] = json!([name]);
    let mappings = json!([{ "variants": [1], "material": 1 }]);
    file.json["meshes"][0]["primitives"][0]["extensions"] = json!({ name: { "mappings": mappings } });
    let used = |variant: Option<&str>| {
        let options = ReadOptions { variant: variant.map(str::to_owned), ..ReadOptions::default() };
        let scene = file.read_with(&options)?;
        assert_eq!(scene.warnings, [""; 0]);
        Ok::<_, ReadError>(scene.materials[scene.meshes[0].parts[0].material.0 as usize].name.clone())
    };
    assert_eq!(used(None).unwrap(), "plain");
    assert_eq!(used(Some("day")).unwrap(), "plain", "no mapping");
    assert_eq!([used(Some("night")).unwrap(), used(Some("1")).unwrap()], ["red", "red"]);
    let error = used(Some("dawn")).unwrap_err().to_string();
    assert!(error.contains("unknown variant 'dawn'; the file has 0 \"day\", 1 \"night\""), "{error}");
}

const STORED: [u8; 4] = [1, 2, 3, 4];

/// The triangle with a texture of two images: STORED data or others, and the PNG.
fn file_of_format(texture: Value, image: &[u8]) -> File {
    let mut file = file(textured(json!({})));
    let (special, plain) = (file.view(image), file.json["images"][0]["bufferView"].clone());
    file.json["images"] =
        json!([{ "bufferView": special, "name": "special" }, { "bufferView": plain, "name": "plain" }]);
    file.json["textures"] = json!([texture]);
    file
}

fn basisu(fallback: Option<usize>) -> Value {
    let mut texture = json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } });
    if let Some(fallback) = fallback {
        texture["source"] = json!(fallback);
    }
    texture
}

#[test]
#[cfg(feature = "ktx2")]
fn ktx2_takes_precedence_and_png_stands_in() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/files/ktx2/uastc.ktx2");
    let ktx2 = std::fs::read(path).unwrap();
    for fallback in [None, Some(1)] {
        let scene = file_of_format(basisu(fallback), &ktx2).scene();
        assert_eq!((scene.textures.len(), &scene.textures[0].name[..]), (1, "special"));
        assert_eq!((scene.textures[0].width, scene.textures[0].height), (12, 8));
    }
    let scene = file_of_format(basisu(Some(1)), &STORED).warned("skipping image 0 'special'");
    assert_eq!((scene.textures.len(), &scene.textures[0].name[..]), (1, "plain"));
    assert!(file_of_format(basisu(None), &STORED).warned("skipping image 0").textures.is_empty());
    file_of_format(json!({ "extensions": { "KHR_texture_basisu": { "source": 2 } } }), &ktx2)
        .rejected("image index 2 out of range");
}

#[test]
#[cfg(not(feature = "ktx2"))]
fn without_the_feature_png_is_used() {
    let scene = file_of_format(basisu(Some(1)), &STORED).scene();
    assert_eq!((scene.textures.len(), &scene.textures[0].name[..]), (1, "plain"));
    file_of_format(basisu(None), &STORED).warned("KHR_texture_basisu, feature 'ktx2' (not supported)");
}
