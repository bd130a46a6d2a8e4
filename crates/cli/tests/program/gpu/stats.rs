//! `canted stats --device`: GPU buffers and build times.

use crate::support::Folder;

use super::adapter;

#[test]
fn stats_list_gpu_buffers() {
    let folder = Folder::with_small();
    assert!(folder.run("stats small.obj --json --device cpu").done().json().get("device").is_none());
    let Some(name) = adapter("stats_list_gpu_buffers") else { return };
    let found = folder.run("stats small.obj --json --device gpu").done().json()["device"].clone();
    assert_eq!(found["name"], *name);
    let buffers = found["buffers"].as_array().unwrap();
    let n_bytes: u64 = buffers.iter().map(|buffer| buffer["bytes"].as_u64().unwrap()).sum();
    assert_eq!(found["bytes"], n_bytes);
    let names: Vec<&str> = buffers.iter().map(|buffer| buffer["name"].as_str().unwrap()).collect();
    // Three triangles without textures and emission, in the default light.
    let has = |name: &str| names.contains(&name);
    assert!(has("triangles") && has("lights") && !has("texels_0") && !has("emitters"), "{names:?}");
    let text = folder.run("stats small.obj --device gpu").done().stdout;
    assert!(text.contains(&format!("Buffers for a picture on {name}: {},", names.len())), "{text}");
}

#[test]
fn stats_report_build_times() {
    let Some(name) = adapter("stats_report_build_times") else { return };
    let folder = Folder::with_small();
    let build = folder.run("stats small.obj --json --device gpu").done().json()["device"]["build"].clone();
    for (level, n_items) in [("one_level", 3), ("bottom_levels", 3), ("top_level", 2)] {
        let level = &build["levels"][level];
        assert_eq!(level["items"], n_items, "{build}");
        for pass in ["domain_ms", "codes_ms", "sort_ms", "tree_ms"] {
            assert!(level[pass].as_f64().is_some_and(|ms| ms >= 0.0), "{pass} of {level}");
        }
        let strategies: Vec<&String> = level["volumes_ms"].as_object().unwrap().keys().collect();
        assert_eq!(strategies, ["aabb", "combined", "dop", "pca-bounded", "pca-unbounded", "quaternion"]);
    }
    assert!(build["levels"]["one_level"]["sort_ms"].as_f64().unwrap() > 0.0, "{build}");
    assert!(build["rebuild_top_ms"].as_f64().unwrap() > 0.0, "{build}");
    let text = folder.run("stats small.obj --device gpu").done().stdout;
    assert!(text.contains(&format!("Build times in milliseconds on {name} (")), "{text}");
}
