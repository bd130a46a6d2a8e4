//! Further lobes, specular and glossiness, and material variants.

use serde_json::{Value, json};

use super::materials::file;
use super::surfaces::surface;
use crate::read::{ReadError, ReadOptions};
use crate::{Encoding, Material, TextureId, TextureRef};

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
