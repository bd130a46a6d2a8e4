//! Materials and textures: factors, masks, wrap modes, coordinates, transforms, unreadable images.

use serde_json::{Value, json};

use super::{File, TRIANGLE};
use crate::{AlphaMode, Magnification, Scene, TextureId, TextureRef, UvSet, Wrap};

/// A 2 x 1 PNG: opaque red, transparent gray.
pub(super) fn png() -> Vec<u8> {
    let image = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([[255, 0, 0, 255], [128, 128, 128, 0]][x as usize]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Texture coordinates of set 0; set 1 has them reversed.
pub(super) const UVS: [f32; 6] = [0.0, 0.0, 0.5, 0.25, 1.0, 1.0];

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
pub(super) fn textured(info: Value) -> Value {
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
fn reads_images_from_files_and_data_uris() {
    let mut external = file(textured(json!({})));
    external.json["images"][0] = json!({ "uri": "tex%20tures/a.png" });
    let scene = external
        .read_beside(|folder| {
            std::fs::create_dir(folder.join("tex tures")).unwrap();
            std::fs::write(folder.join("tex tures/a.png"), png()).unwrap();
        })
        .unwrap();
    assert_eq!(scene.textures[0].texels.len(), 2);
    external.json["images"][0] = json!({ "uri": format!("data:image/png;base64,{}", super::to_base64(&png())) });
    assert_eq!(external.scene().textures[0].texels.len(), 2);
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
