//! Poses of animated files: each equals the scene that is read at that time, and bad poses are reported.

use std::path::{Path, PathBuf};

use canted_scene::{AnimatedScene, ReadError, ReadOptions, Scene, read_with};
use serde_json::{Value, json};

use crate::folder::models;

/// A folder with a glTF file.
struct File(tempfile::TempDir);

impl File {
    /// A triangle that node 0 moves by 8 in a second of animation 0, and by `far` of animation 1; node 2 shows the triangle
    /// with a morph target `lift` of a weight that goes from 0 to 1.
    fn new(far: f32, lift: [f32; 3]) -> Self {
        Self::with(far, lift, |_| {})
    }

    fn with(far: f32, lift: [f32; 3], change: impl FnOnce(&mut Value)) -> Self {
        let floats: [&[f32]; 6] = [
            &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            &[0.0, 1.0],
            &[0.0, 0.0, 0.0, 8.0, 0.0, 0.0],
            &[0.0, 0.0, 0.0, far, 0.0, 0.0],
            &[0.0, 0.0, 0.0, lift[0], lift[1], lift[2], 0.0, 0.0, 0.0],
            &[0.0, 1.0],
        ];
        let (mut views, mut bytes) = (Vec::new(), Vec::new());
        for list in floats {
            views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * list.len() }));
            bytes.extend(list.iter().flat_map(|x| x.to_le_bytes()));
        }
        let accessor = |view: usize, element: &str| {
            let width = if element == "VEC3" { 3 } else { 1 };
            json!({ "bufferView": view, "componentType": 5126, "type": element, "count": floats[view].len() / width })
        };
        let move_node = |output: usize| {
            json!({
                "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
                "samplers": [{ "input": 1, "output": output }],
            })
        };
        let mut first = move_node(2);
        first["name"] = json!("slide");
        first["channels"]
            .as_array_mut()
            .unwrap()
            .push(json!({ "sampler": 1, "target": { "node": 2, "path": "weights" } }));
        first["samplers"].as_array_mut().unwrap().push(json!({ "input": 1, "output": 5 }));
        let mut json = json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "byteLength": bytes.len(), "uri": "data.bin" }],
            "bufferViews": views,
            "accessors": [accessor(0, "VEC3"), accessor(1, "SCALAR"), accessor(2, "VEC3"), accessor(3, "VEC3"),
                accessor(4, "VEC3"), accessor(5, "SCALAR")],
            "meshes": [
                { "name": "fixed", "primitives": [{ "attributes": { "POSITION": 0 } }] },
                { "name": "sail", "primitives": [{ "attributes": { "POSITION": 0 }, "targets": [{ "POSITION": 4 }] }] },
            ],
            "nodes": [{ "mesh": 0 }, { "mesh": 0, "translation": [0, 5, 0] }, { "mesh": 1 }],
            "animations": [first, move_node(3)],
        });
        change(&mut json);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("data.bin"), bytes).unwrap();
        std::fs::write(folder.path().join("moving.gltf"), json.to_string()).unwrap();
        Self(folder)
    }

    fn path(&self) -> PathBuf {
        self.0.path().join("moving.gltf")
    }
}

fn at(time: f32, animation: Option<&str>) -> ReadOptions {
    ReadOptions { time: Some(time), animation: animation.map(str::to_owned), variant: None }
}

/// Everything that a pose may change, and everything that it must not.
fn everything(scene: &Scene) -> String {
    format!("{scene:?}")
}

/// Compares poses in any order with the file read at that time.
#[track_caller]
fn poses_match(path: &Path, animation: Option<&str>, times: &[f32]) {
    let (mut animated, mut scene) = AnimatedScene::open(path, &at(times[0], animation)).unwrap();
    assert!(animated.is_animated());
    for &time in times.iter().chain(times.iter().rev()) {
        let mut read = read_with(path, &at(time, animation)).unwrap();
        animated.pose(time, &mut scene).unwrap();
        // The warnings of a pose do not repeat those of materials and images.
        let without_warnings = |scene: &mut Scene| std::mem::take(&mut scene.warnings);
        let (ours, theirs) = (without_warnings(&mut scene), without_warnings(&mut read));
        assert!(ours.iter().all(|warning| theirs.contains(warning)), "{ours:?} {theirs:?}");
        assert_eq!(everything(&scene), everything(&read), "{path:?} at {time}");
    }
}

#[test]
fn poses_are_those_of_the_file_read_at_that_time() {
    let file = File::new(-4.0, [0.0, 0.0, 2.0]);
    // At 0 the second mesh has its default weights, so that it is no deformed copy.
    for animation in [None, Some("slide"), Some("0"), Some("1")] {
        poses_match(&file.path(), animation, &[0.0, 0.25, 1.0, 7.0, -1.0, 0.5]);
    }
    let (mut animated, mut scene) = AnimatedScene::open(&file.path(), &at(0.0, Some("1"))).unwrap();
    animated.pose(0.5, &mut scene).unwrap();
    assert_eq!(scene.instances[0].world_from_object.columns[3], [-2.0, 0.0, 0.0], "the second animation");
    assert!(scene.warnings.is_empty(), "an animation was chosen: {:?}", scene.warnings);
}

#[test]
fn poses_of_real_models_are_those_of_the_file_read_at_that_time() {
    let Some(folder) = models("poses_of_real_models_are_those_of_the_file_read_at_that_time") else { return };
    for (name, animation) in [("Fox", None), ("Fox", Some("Run")), ("Fox", Some("2")), ("CesiumMan", None)] {
        poses_match(&folder.join(format!("gltf/{name}.glb")), animation, &[0.0, 0.3, 1.1]);
    }
    for name in ["SimpleSkin", "SimpleMorph"] {
        poses_match(&folder.join(format!("gltf/{name}.gltf")), None, &[0.0, 0.3, 1.1]);
    }
}

#[test]
fn unknown_animations_are_reported_with_those_of_the_file() {
    let file = File::new(1.0, [0.0; 3]);
    let error = |animation: &str| match read_with(&file.path(), &at(0.0, Some(animation))) {
        Err(error @ ReadError::UnknownAnimation { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    for wanted in ["swim", "2", "-1", ""] {
        let want = format!("moving.gltf: unknown animation '{wanted}'; the file has 0 \"slide\", 1");
        assert!(error(wanted).ends_with(&want), "{}", error(wanted));
    }
    let still = File::with(1.0, [0.0; 3], |json| drop(json.as_object_mut().unwrap().remove("animations")));
    for options in [at(0.0, Some("slide")), ReadOptions { time: None, ..at(0.0, Some("0")) }] {
        let error = read_with(&still.path(), &options).unwrap_err().to_string();
        assert!(error.ends_with("the file has no animation"), "{error}");
    }
    assert!(!AnimatedScene::open(&still.path(), &ReadOptions::default()).unwrap().0.is_animated());
}

/// A name that looks like a number is a name.
#[test]
fn names_win_over_numbers() {
    let file = File::with(-4.0, [0.0; 3], |json| json["animations"][1]["name"] = json!("0"));
    let x = |animation| {
        read_with(&file.path(), &at(1.0, Some(animation))).unwrap().instances[0].world_from_object.columns[3][0]
    };
    assert_eq!([x("0"), x("slide"), x("1")], [-4.0, 8.0, -4.0]);
}

#[test]
fn poses_that_are_not_finite_are_reported_with_mesh_and_vertex() {
    for bad in [f32::NAN, f32::INFINITY] {
        let file = File::new(bad, [0.0, bad, 0.0]);
        let (mut animated, mut scene) = AnimatedScene::open(&file.path(), &at(0.0, None)).unwrap();
        let before = everything(&scene);
        let error = animated.pose(0.5, &mut scene).unwrap_err();
        let want = format!("mesh 1 \"sail\": primitive 0 vertex 1 is not finite: 1, {bad}, 0");
        assert!(matches!(&error, ReadError::VertexNotFinite { .. }) && error.to_string().ends_with(&want), "{error}");
        assert_eq!(everything(&scene), before, "the scene stays as it is");
        // A static picture skips the triangle with a warning, as before.
        assert!(read_with(&file.path(), &at(0.5, None)).unwrap().warnings.join("").contains("non-finite vertex: 1"));
        // Infinity times zero is NaN, so the node is at NaN even at the first key.
        let error = AnimatedScene::open(&file.path(), &at(0.5, Some("1"))).err().unwrap().to_string();
        assert!(error.contains("mesh 0 \"fixed\": vertex 0 at node 0 is not finite: "), "{error}");
    }
}

/// Vertices that are not finite in the file, at rest and in every pose, lose their triangles with a warning, as elsewhere.
#[test]
fn vertices_that_are_not_finite_at_rest_are_skipped() {
    let file = File::with(f32::NAN, [0.0; 3], |json| {
        // The first vertex of the first mesh becomes the last key of the second animation.
        json["accessors"].as_array_mut().unwrap().push(
            json!({ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "sparse": {
            "count": 1,
            "indices": { "bufferView": 1, "componentType": 5121 },
            "values": { "bufferView": 3, "byteOffset": 12 },
        } }),
        );
        json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(6);
    });
    let (_, scene) = AnimatedScene::open(&file.path(), &at(0.5, Some("slide"))).unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1), "the other mesh");
    assert!(scene.warnings.join("").contains("skipping triangles with a non-finite vertex: 1"), "{:?}", scene.warnings);
}
