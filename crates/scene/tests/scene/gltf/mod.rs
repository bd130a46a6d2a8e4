//! glTF: generated files, and those of real exporters.

mod compressed;
mod files;
mod geometry;
mod materials;
mod nodes;
mod poses;
mod real;

use std::fs;
use std::path::{Path, PathBuf};

use canted_scene::{ReadError, ReadOptions, Scene, read, read_with};
use serde_json::{Value, json};

/// Component type codes.
const I8: u32 = 5120;
const U8: u32 = 5121;
const I16: u32 = 5122;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// Positions of the test triangle.
const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// A file under construction: JSON and one buffer.
#[derive(Clone)]
struct File {
    json: Value,
    buffer: Vec<u8>,
}

impl File {
    /// An empty file.
    fn new() -> Self {
        Self { json: json!({ "asset": { "version": "2.0" } }), buffer: Vec::new() }
    }

    /// The test triangle as mesh 0, with the given nodes.
    fn of_nodes(nodes: Value) -> Self {
        let mut file = Self::new();
        let positions = file.reals("VEC3", &TRIANGLE);
        file.mesh(json!([{ "attributes": { "POSITION": positions } }]));
        file.json["nodes"] = nodes;
        file
    }

    /// Adds a mesh of these primitives and a node for it.
    fn with_node(mut self, primitives: Value) -> Self {
        let mesh = self.mesh(primitives);
        self.push("nodes", json!({ "mesh": mesh }));
        self
    }

    /// Appends to a list and returns the index.
    fn push(&mut self, list: &str, item: Value) -> usize {
        if self.json[list].is_null() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(item);
        list.len() - 1
    }

    /// Appends a mesh.
    fn mesh(&mut self, primitives: Value) -> usize {
        self.push("meshes", json!({ "primitives": primitives }))
    }

    /// Appends bytes and a view of them.
    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.buffer.len();
        self.buffer.extend(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// Appends an accessor of packed elements.
    fn accessor(&mut self, component: u32, element: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.accessor_of(view, component, element, count)
    }

    /// Appends an accessor of a view.
    fn accessor_of(&mut self, view: usize, component: u32, element: &str, count: usize) -> usize {
        let accessor = json!({ "bufferView": view, "componentType": component, "type": element, "count": count });
        self.push("accessors", accessor)
    }

    /// Appends an accessor of `f32` numbers.
    fn reals(&mut self, element: &str, numbers: &[f32]) -> usize {
        let width = ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|name| *name == element).map_or(16, |k| k + 1);
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(F32, element, numbers.len() / width, &bytes)
    }

    /// Appends an accessor of 16-bit indices.
    fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        self.accessor(U16, "SCALAR", indices.len(), &bytes)
    }

    /// The file as GLB.
    fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.buffer.len() }]);
        let chunk = |kind: &[u8; 4], content: &[u8], padding: u8| {
            let mut content = content.to_vec();
            content.resize(content.len().next_multiple_of(4), padding);
            [&word(content.len())[..], kind, &content].concat()
        };
        let chunks = [chunk(b"JSON", json.to_string().as_bytes(), b' '), chunk(b"BIN\0", &self.buffer, 0)].concat();
        [b"glTF", &2_u32.to_le_bytes()[..], &word(12 + chunks.len()), &chunks].concat()
    }

    /// Writes the file and its buffer to a folder; the path.
    fn write(&self, folder: &Path) -> PathBuf {
        let mut json = self.json.clone();
        if json["buffers"].is_null() && !self.buffer.is_empty() {
            json["buffers"] = json!([{ "byteLength": self.buffer.len(), "uri": "buffer.bin" }]);
        }
        fs::write(folder.join("buffer.bin"), &self.buffer).unwrap();
        let path = folder.join("test.gltf");
        fs::write(&path, json.to_string()).unwrap();
        path
    }

    /// The file in a folder of its own.
    fn saved(&self) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = self.write(folder.path());
        (folder, path)
    }

    /// Writes the file into a folder of its own and reads it.
    fn read(&self) -> Result<Scene, ReadError> {
        self.read_with(&ReadOptions::default())
    }

    /// As [`File::read`], at a time.
    fn read_at(&self, time: f32) -> Result<Scene, ReadError> {
        self.read_with(&ReadOptions { time: Some(time), ..ReadOptions::default() })
    }

    /// As [`File::read`], with options.
    fn read_with(&self, options: &ReadOptions) -> Result<Scene, ReadError> {
        let (_folder, path) = self.saved();
        read_with(&path, options)
    }

    /// The scene, which must have no warnings.
    #[track_caller]
    fn scene(&self) -> Scene {
        let scene = self.read().unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scene.warnings, [""; 0]);
        scene
    }

    /// Asserts that reading fails with a message that contains `thing`.
    #[track_caller]
    fn rejected(&self, thing: &str) {
        let error = self.read().expect_err(thing).to_string();
        assert!(error.contains("test.gltf") && error.contains(thing), "{error}");
    }

    /// Asserts that reading gives one warning, which contains `thing`.
    #[track_caller]
    fn warned(&self, thing: &str) -> Scene {
        let scene = self.read().unwrap_or_else(|error| panic!("{error}"));
        assert!(scene.warnings.len() == 1 && scene.warnings[0].contains(thing), "{:?}", scene.warnings);
        scene
    }
}

/// A length as a little-endian word.
fn word(length: usize) -> [u8; 4] {
    u32::try_from(length).unwrap().to_le_bytes()
}

/// Writes and reads a file.
fn read_bytes(folder: &Path, name: &str, bytes: &[u8]) -> Result<Scene, ReadError> {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    read(&path)
}

#[test]
fn json_and_glb_give_the_same_scene() {
    let file = File::of_nodes(json!([{ "mesh": 0, "translation": [1, 2, 3] }]));
    let folder = tempfile::tempdir().unwrap();
    let glb = read_bytes(folder.path(), "test.glb", &file.glb()).unwrap();
    let json = file.scene();
    assert_eq!(json.meshes[0].positions, glb.meshes[0].positions);
    assert_eq!(json.instances, glb.instances);
}

#[test]
fn checks_versions_and_required_extensions() {
    let with = |key: &str, value: Value| {
        let mut file = File::of_nodes(json!([{ "mesh": 0 }]));
        file.json[key] = value;
        file
    };
    with("asset", json!({ "version": "2.1" })).scene();
    with("asset", json!({ "version": "1.0" })).rejected("glTF 1.0 is not supported");
    let mut first = with("asset", json!({}));
    first.json["meshes"] = json!({ "a": {} });
    first.rejected("glTF 1.0 is not supported");
    with("asset", json!({ "version": "2.1", "minVersion": "2.1" })).rejected("glTF 2.1 is not supported");
    with("extensionsRequired", json!(["KHR_mesh_quantization"])).scene();
    with("extensionsRequired", json!(["EXT_unheard_of"]))
        .rejected("required extension EXT_unheard_of is not supported");
    with("extensionsUsed", json!(["KHR_mesh_quantization", "KHR_lights_punctual"])).scene();
    with("extensionsUsed", json!(["EXT_unheard_of"])).warned("ignoring EXT_unheard_of (not supported): extensionsUsed");
    with("extensionsRequired", json!(["KHR_xmp_json_ld"])).scene();
    let hidden = json!({ "KHR_node_visibility": { "visible": false } });
    let shown = json!({ "KHR_node_visibility": { "visible": true } });
    let mut file = with(
        "nodes",
        json!([
            { "mesh": 0, "extensions": hidden, "children": [1] },
            { "mesh": 0, "extensions": shown, "translation": [1, 0, 0] },
            { "mesh": 0, "extensions": shown, "translation": [2, 0, 0] },
        ]),
    );
    file.json["extensionsUsed"] = json!(["KHR_node_visibility"]);
    file.json["extensionsRequired"] = json!(["KHR_node_visibility"]);
    file.json["scenes"] = json!([{ "nodes": [0, 2] }]);
    let scene = file.scene();
    let origins: Vec<_> = scene.instances.iter().map(|instance| instance.world_from_object.columns[3]).collect();
    assert_eq!(origins, [[2.0, 0.0, 0.0]], "a hidden node hides those below");
}

#[test]
fn invalid_json_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    for text in [
        "{",
        "[1]",
        "{\"asset\":{}}",
        &"[".repeat(1 << 20),
        "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"mesh\":-1}]}",
        "\u{feff}{}",
    ] {
        let error = read_bytes(folder.path(), "test.gltf", text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("test.gltf: json: "), "{error}");
    }
}
