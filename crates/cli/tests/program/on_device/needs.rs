//! `canted stats --device`: what a device needs for a scene, and what its passes take.

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
    // Three triangles without textures and emission, in the light that a picture gives to what has none.
    let has = |name: &str| names.contains(&name);
    assert!(has("triangles") && has("lights") && !has("texels_0") && !has("emitters"), "{names:?}");
    let text = folder.run("stats small.obj --device gpu").done().stdout;
    assert!(text.contains(&format!("Buffers of a picture on {name}: {},", names.len())), "{text}");
}

#[test]
fn stats_time_every_pass_of_a_build() {
    let Some(name) = adapter("stats_time_every_pass_of_a_build") else { return };
    let folder = Folder::with_small();
    let build = folder.run("stats small.obj --json --device gpu").done().json()["device"]["build"].clone();
    for (level, n_items) in [("one_level", 3), ("bottom_levels", 3), ("top_level", 2)] {
        let level = &build["levels"][level];
        assert_eq!(level["items"], n_items, "{build}");
        for pass in ["domain_ms", "codes_ms", "sort_ms", "tree_ms"] {
            assert!(level[pass].as_f64().is_some_and(|ms| ms >= 0.0), "{pass} of {level}");
        }
        let boxes: Vec<&String> = level["boxes_ms"].as_object().unwrap().keys().collect();
        assert_eq!(boxes, ["aabb", "combined", "dop", "pca-bounded", "quaternion"]);
    }
    assert!(build["levels"]["one_level"]["sort_ms"].as_f64().unwrap() > 0.0, "{build}");
    assert!(build["moved_ms"].as_f64().unwrap() > 0.0, "{build}");
    let text = folder.run("stats small.obj --device gpu").done().stdout;
    assert!(text.contains(&format!("Milliseconds a pass on {name}, by ")), "{text}");
}
