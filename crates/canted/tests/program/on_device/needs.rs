//! `canted stats --device`: what a device needs for a scene.

use crate::support::Folder;

use super::adapter;

#[test]
fn stats_count_the_buffers_of_a_device_only_where_one_is_meant() {
    let folder = Folder::with_small();
    assert!(folder.run("stats small.obj --json --device cpu").done().json().get("device").is_none());
    let Some(name) = adapter("stats_count_the_buffers_of_a_device_only_where_one_is_meant") else { return };
    let found = folder.run("stats small.obj --json --device gpu").done().json()["device"].clone();
    assert_eq!(found["name"], *name);
    let buffers = found["buffers"].as_array().unwrap();
    let n_bytes: u64 = buffers.iter().map(|buffer| buffer["bytes"].as_u64().unwrap()).sum();
    assert_eq!(found["bytes"], n_bytes);
    let names: Vec<&str> = buffers.iter().map(|buffer| buffer["name"].as_str().unwrap()).collect();
    // Three triangles without textures, normals and lights.
    assert!(names.contains(&"triangles") && !names.contains(&"texels_0") && !names.contains(&"lights"), "{names:?}");
    let text = folder.run("stats small.obj --device gpu").done().stdout;
    assert!(text.contains(&format!("Buffers of a picture on {name}: {},", names.len())), "{text}");
}
