//! Files with bytes changed, cut or repeated: any outcome but a panic, and what is read keeps its promises.

use std::sync::OnceLock;

use proptest::prelude::*;
use serde_json::json;

use super::{File, TRIANGLE, U8, read_bytes, word};
use crate::Scene;

/// A small GLB with something of everything.
fn rich() -> &'static [u8] {
    static GLB: OnceLock<Vec<u8>> = OnceLock::new();
    GLB.get_or_init(|| {
        let mut file = File::new();
        let (positions, uvs) = (file.reals("VEC3", &TRIANGLE), file.reals("VEC2", &TRIANGLE[..6]));
        let (strip, indices) = (file.reals("VEC3", &[TRIANGLE, TRIANGLE].concat()), file.indices(&[0, 1, 2, 4, 5]));
        let joints = file.accessor(U8, "VEC4", 3, &[0; 12]);
        let weights = file.reals("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(3));
        let (replaced, values) = (file.view(&[1]), file.view(&[0; 12]));
        file.json["accessors"][strip]["sparse"] = json!({
            "count": 1,
            "indices": { "bufferView": replaced, "componentType": U8 },
            "values": { "bufferView": values },
        });
        file.json["textures"] = json!([{ "source": 0 }]);
        let png = crate::read::image::tests::encoded(image::ImageFormat::Png);
        let view = file.view(&png);
        file.json["images"] = json!([{ "bufferView": view }]);
        file.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
        file.json["skins"] = json!([{ "joints": [2] }]);
        file.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 1 } }]);
        file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
        let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs, "JOINTS_0": joints, "WEIGHTS_0": weights });
        file.mesh(json!([{ "attributes": attributes, "material": 0, "targets": [{ "POSITION": positions }] }]));
        file.mesh(json!([{ "attributes": { "POSITION": strip }, "indices": indices, "mode": 5 }]));
        file.json["meshes"][0]["weights"] = json!([0.5]);
        file.json["nodes"] = json!([
            { "mesh": 0, "skin": 0, "children": [1, 2] },
            { "mesh": 1, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": positions } } } },
            { "camera": 0, "scale": [1, 2, 3], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ]);
        file.json["scenes"] = json!([{ "nodes": [0] }]);
        file.glb()
    })
}

/// Whether the scene keeps its promises: indices in range, used positions finite, lists of one length.
fn is_sound(scene: &Scene) -> bool {
    let meshes_are_sound = scene.meshes.iter().all(|mesh| {
        let n_vertices = mesh.positions.len();
        let corner_is_sound =
            |&corner: &u32| mesh.positions.get(corner as usize).is_some_and(|p| p.iter().all(|x| x.is_finite()));
        mesh.triangles.as_flattened().iter().all(corner_is_sound)
            && mesh.uvs.as_ref().is_none_or(|uvs| uvs.len() == n_vertices)
            && mesh.normals.as_ref().is_none_or(|normals| normals.len() == n_vertices)
            && mesh.parts.first().is_some_and(|part| part.first_triangle == 0)
            && mesh.parts.iter().all(|part| (part.material.0 as usize) < scene.materials.len())
    });
    let instance_is_sound = |instance: &crate::Instance| {
        let placed = &instance.world_from_object;
        (instance.mesh.0 as usize) < scene.meshes.len() && placed.is_finite() && placed.determinant() != 0.0
    };
    meshes_are_sound && !scene.instances.is_empty() && scene.instances.iter().all(instance_is_sound)
}

#[test]
fn the_unchanged_file_has_everything() {
    let folder = tempfile::tempdir().unwrap();
    let scene = read_bytes(folder.path(), "rich.glb", rich()).unwrap();
    assert!(is_sound(&scene));
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.n_placed_triangles()), (2, 4, 10));
    assert_eq!((scene.textures.len(), scene.cameras.len(), scene.lights.len()), (1, 1, 1));
}

#[test]
fn the_check_sees_unsound_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = read_bytes(folder.path(), "rich.glb", rich()).unwrap();
    let breaks: [fn(&mut Scene); 5] = [
        |scene| scene.meshes[0].triangles[0][2] = 99,
        |scene| scene.meshes[0].positions[1][0] = f32::NAN,
        |scene| scene.meshes[0].parts.clear(),
        |scene| scene.instances[0].mesh.0 = 7,
        |scene| scene.instances[0].world_from_object.columns[0] = [0.0; 3],
    ];
    for make_unsound in breaks {
        let mut scene = scene.clone();
        make_unsound(&mut scene);
        assert!(!is_sound(&scene));
    }
}

/// A change of the file: at a place, other bytes instead of some.
fn change() -> impl Strategy<Value = (prop::sample::Index, usize, Vec<u8>)> {
    let bytes = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..5),
        // Digits and brackets keep the JSON legal more often than random bytes.
        prop::sample::select(vec!["0", "9", "-1", "1e39", "[]", "4294967295", "null", ",0"]).prop_map(Vec::from),
        Just(vec![0xff; 4]),
        Just(vec![0x00, 0x00, 0xc0, 0x7f]),
    ];
    (any::<prop::sample::Index>(), 0_usize..5, bytes)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn mutated_files_never_panic(changes in prop::collection::vec(change(), 1..4)) {
        let mut bytes = rich().to_vec();
        for (at, n_removed, inserted) in changes {
            let start = at.index(bytes.len());
            let end = (start + n_removed).min(bytes.len());
            bytes.splice(start..end, inserted);
        }
        // The header promises the new length and the JSON chunk takes the difference, so that the change is reached.
        if bytes.len() >= 20 {
            let json_length = u32::from_le_bytes(rich()[12..16].try_into().unwrap()) as usize;
            let (total, json) = (word(bytes.len()), word((json_length + bytes.len()).saturating_sub(rich().len())));
            bytes[8..12].copy_from_slice(&total);
            bytes[12..16].copy_from_slice(&json);
        }
        let folder = tempfile::tempdir().unwrap();
        if let Ok(scene) = read_bytes(folder.path(), "mutated.glb", &bytes) {
            prop_assert!(is_sound(&scene));
        }
    }
}
