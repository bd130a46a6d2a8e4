//! Materials and textures: factors, masks, wrap modes, coordinates and their transform, images that cannot be read.

use serde_json::{Value, json};

use super::{File, TRIANGLE};
use crate::{AlphaMode, Scene, TextureId, TextureRef, UvSet, Wrap};

/// A 2 x 1 PNG: red with full alpha, mid grey without.
pub(super) fn png() -> Vec<u8> {
    let image = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([[255, 0, 0, 255], [128, 128, 128, 0]][x as usize]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Texture coordinates of set 0; set 1 has them in reverse order.
pub(super) const UVS: [f32; 6] = [0.0, 0.0, 0.5, 0.25, 1.0, 1.0];

/// The triangle with two sets of coordinates, this material, and the PNG in a buffer view as image 0.
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
    file.place(json!([{ "attributes": attributes, "material": 0 }]))
}

/// A material with texture 0 as its base colour.
pub(super) fn textured(info: Value) -> Value {
    let mut info = info;
    info["index"] = json!(0);
    json!({ "pbrMetallicRoughness": { "baseColorTexture": info } })
}

fn uvs(scene: &Scene) -> &[[f32; 2]] {
    scene.meshes[0].uvs.as_deref().unwrap()
}

#[test]
fn factors() {
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
    assert!(scene.meshes[0].uvs.is_none() && scene.textures.is_empty(), "what nothing needs costs nothing");
    let scene = file(json!({})).scene();
    assert_eq!((&scene.materials[0].name[..], scene.materials[0].base_color), ("material 0", [1.0; 3]));
    let scene = file(json!({ "pbrMetallicRoughness": { "baseColorFactor": [2, -1, 0.5, 1] } })).warned("base colour");
    assert_eq!(scene.materials[0].base_color, [1.0, 0.0, 0.5]);
    let scene = file(json!({ "emissiveFactor": [-1, 0, 0] })).warned("emission");
    assert_eq!(scene.materials[0].emission, [0.0; 3]);
}

#[test]
fn a_texture_brings_its_texels_and_coordinates() {
    let scene = file(textured(json!({}))).scene();
    assert_eq!(scene.materials[0].base_color_texture, Some(TextureRef::new(TextureId(0))));
    assert_eq!(scene.materials[0].alpha_texture, None);
    let texture = &scene.textures[0];
    assert_eq!((&texture.name[..], texture.width, texture.height), ("two texels", 2, 1));
    assert_eq!(texture.texels, [[255, 0, 0, 255], [128, 128, 128, 0]]);
    assert_eq!(uvs(&scene), [[0.0, 1.0], [0.5, 0.75], [1.0, 0.0]], "v points up");
    assert!(scene.meshes[0].second_uvs.is_none(), "what nothing needs costs nothing");
    let scene = file(textured(json!({ "texCoord": 1 }))).scene();
    assert_eq!(scene.materials[0].base_color_texture.unwrap().uv_set, UvSet::Second);
    assert_eq!(scene.meshes[0].second_uvs.as_ref().unwrap()[0], [1.0, 0.0]);
    assert!(scene.meshes[0].uvs.is_none());
}

/// Where the base colour's texture is looked up at the corners of the triangle.
fn looked_up(scene: &Scene) -> Vec<[f64; 2]> {
    let texture = scene.materials[0].base_color_texture.unwrap();
    let uvs = scene.meshes[0].uv_set(texture.uv_set).unwrap();
    uvs.iter().map(|uv| texture.texture_from_mesh.point(uv.map(f64::from))).collect()
}

#[test]
fn textures_transform_coordinates() {
    let with = |transform: Value| {
        let info = json!({ "extensions": { "KHR_texture_transform": transform } });
        looked_up(&file(textured(info)).scene())
    };
    assert_eq!(with(json!({})), [[0.0, 1.0], [0.5, 0.75], [1.0, 0.0]]);
    assert_eq!(with(json!({ "scale": [2, 4], "offset": [0.5, 0.25] }))[1], [1.5, 1.0 - 1.25]);
    assert_eq!(with(json!({ "texCoord": 1 }))[0], [1.0, 0.0], "it overrides the set");
    // The example of the extension: the lower left quadrant of the image, turned.
    let turned = with(json!({ "offset": [0, 1], "rotation": std::f32::consts::FRAC_PI_2, "scale": [0.5, 0.5] }));
    // Each number of a row is rounded once, and is below 1.
    let rounding = 1.5 * f64::from(f32::EPSILON);
    for ([u, v], want) in turned.into_iter().zip([[0.0, 0.0], [0.125, 0.25], [0.5, 0.5]]) {
        assert!((u - want[0]).abs() <= rounding && (v - want[1]).abs() <= rounding, "{u} {v} for {want:?}");
    }
    let infinite = textured(json!({ "extensions": { "KHR_texture_transform": { "scale": [1e39, 1] } } }));
    assert!(file(infinite).warned("not finite").textures.is_empty());
}

#[test]
fn masks() {
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
    assert_eq!(with(1.0, json!({ "alphaMode": "MASK", "alphaCutoff": 0 })).0, AlphaMode::Opaque, "all is seen");
    assert_eq!(with(0.25, json!({ "alphaMode": "BLEND" })), (AlphaMode::Blend, 0.25));
    assert_eq!(with(1.0, json!({ "alphaMode": "OPAQUE" })).0, AlphaMode::Opaque);
    let mut unknown = file(json!({ "alphaMode": "ADD" }));
    unknown.push("materials", json!({ "alphaMode": "blend" }));
    let told = "an alphaMode other than OPAQUE, MASK and BLEND is taken as OPAQUE: material 0 and 1 more";
    assert_eq!(unknown.warned(told).materials[0].alpha_mode, AlphaMode::Opaque);
}

#[test]
fn textures_with_the_same_image_and_wrap_are_one() {
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
fn filters_that_are_not_followed_are_said_once() {
    let with = |sampler: Value| {
        let mut file = file(textured(json!({})));
        file.push("samplers", sampler);
        file.json["textures"][0]["sampler"] = json!(0);
        file.push("textures", json!({ "source": 0, "sampler": 0 }));
        file.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } } }));
        file
    };
    with(json!({ "magFilter": 9729, "minFilter": 9987 })).scene();
    with(json!({ "magFilter": 9728 })).warned("the filter NEAREST is ignored, texels blend: texture 0 and 1 more");
    with(json!({ "minFilter": 9984 })).warned("the filter NEAREST is ignored");
}

#[test]
fn images_that_cannot_be_read_leave_a_plain_colour() {
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
    let scene = named.warned("image 0 `C:\\x\\q.png` of material 0: `C\\u{1b}.png`: ");
    assert!(!scene.warnings[0].contains(char::is_control));
}

#[test]
fn images_of_formats_that_are_not_read_are_said() {
    for name in ["EXT_texture_webp", "KHR_texture_basisu"] {
        let mut file = file(textured(json!({})));
        file.json["textures"][0] = json!({ "extensions": { name: { "source": 0 } } });
        file.json["extensionsUsed"] = json!([name]);
        file.json["extensionsRequired"] = json!([name]);
        file.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.25, 0, 1]);
        file.push("materials", file.json["materials"][0].clone());
        let scene =
            file.warned(&format!("a texture has its image by {name}, which is not read; a plain colour stands for it"));
        assert!(scene.warnings[0].ends_with(": material 0 and 1 more"), "{:?}", scene.warnings);
        assert_eq!((scene.materials[0].base_color, scene.materials[0].base_color_texture), ([0.5, 0.25, 0.0], None));
        assert!(scene.textures.is_empty() && scene.meshes[0].uvs.is_none());
        // One that is read beside it is taken.
        file.json["textures"][0]["source"] = json!(0);
        assert_eq!(file.scene().textures.len(), 1);
    }
    let mut file = file(textured(json!({})));
    file.json["textures"][0] = json!({});
    file.warned("a texture names no image; a plain colour stands for it");
}

#[test]
fn images_beside_the_file_and_in_the_text() {
    let mut beside = file(textured(json!({})));
    beside.json["images"][0] = json!({ "uri": "tex%20tures/a.png" });
    let scene = beside
        .read_beside(|folder| {
            std::fs::create_dir(folder.join("tex tures")).unwrap();
            std::fs::write(folder.join("tex tures/a.png"), png()).unwrap();
        })
        .unwrap();
    assert_eq!(scene.textures[0].texels.len(), 2);
    beside.json["images"][0] = json!({ "uri": format!("data:image/png;base64,{}", super::to_base64(&png())) });
    assert_eq!(beside.scene().textures[0].texels.len(), 2);
}

#[test]
fn indices_beyond_the_lists() {
    let with = |list: &str, key: &str, value: Value| {
        let mut file = file(textured(json!({})));
        file.json[list][0][key] = value;
        file
    };
    with("materials", "pbrMetallicRoughness", json!({ "baseColorTexture": { "index": 1 } }))
        .refused("material 0: names texture 1 of 1");
    with("textures", "source", json!(1)).refused("texture 0: names image 1 of 1");
    with("textures", "sampler", json!(0)).refused("texture 0: names sampler 0 of 0");
    with("images", "bufferView", json!(99)).refused("image 0: names buffer view 99");
}

#[test]
fn a_texture_without_coordinates_is_said() {
    let mut file = file(textured(json!({ "texCoord": 1 })));
    let attributes = file.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
    attributes.remove("TEXCOORD_1");
    let scene = file.warned("TEXCOORD_1");
    assert_eq!(looked_up(&scene), [[0.0, 1.0]; 3]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(0);
    file.refused("accessor 0: is not of type Vec2");
    file.json["materials"][0] = textured(json!({ "texCoord": 3 }));
    assert!(file.warned("TEXCOORD_3 is not read").textures.is_empty());
}
