//! Images of other formats, which extensions name.

use serde_json::{Value, json};

use super::File;

const PNG: [u8; 4] = [1, 2, 3, 4];

/// A triangle with a texture of two images: the one of `texture`, and PNG data.
fn file(texture: Value, image: &[u8]) -> File {
    let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
    file.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
    let uvs = file.reals("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
    let png = crate::read::image::tests::encoded(image::ImageFormat::Png);
    let (special, plain) = (file.view(image), file.view(&png));
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
    let ktx2 = crate::read::ktx2::tests::column().bytes();
    for fallback in [None, Some(1)] {
        let scene = file(basisu(fallback), &ktx2).scene();
        assert_eq!((scene.textures.len(), &scene.textures[0].name[..]), (1, "special"));
        assert_eq!(scene.textures[0].texels, [[10, 20, 30, 40], [50, 60, 70, 80]]);
    }
    let scene = file(basisu(Some(1)), &PNG).warned("skipping image 0 'special'");
    assert_eq!((scene.textures.len(), &scene.textures[0].name[..]), (1, "plain"));
    assert!(file(basisu(None), &PNG).warned("skipping image 0").textures.is_empty());
    file(json!({ "extensions": { "KHR_texture_basisu": { "source": 2 } } }), &ktx2)
        .rejected("image index 2 out of range");
}

#[test]
#[cfg(not(feature = "ktx2"))]
fn without_the_feature_png_is_used() {
    let scene = file(basisu(Some(1)), &PNG).scene();
    assert_eq!((scene.textures.len(), &scene.textures[0].name[..]), (1, "plain"));
    file(basisu(None), &PNG).warned("KHR_texture_basisu, feature 'ktx2' (not supported)");
}

#[test]
#[cfg(feature = "webp")]
fn webp_is_read() {
    let webp = crate::read::image::tests::encoded(image::ImageFormat::WebP);
    let scene = file(json!({ "extensions": { "EXT_texture_webp": { "source": 0 } }, "source": 1 }), &webp).scene();
    assert_eq!((scene.textures.len(), &scene.textures[0].name[..]), (1, "special"));
}
