//! Device selection, and messages where there is none.

use crate::support::{Folder, Run};

use super::adapter;

const RENDER: &str = "render small.obj -o a.png --size 16x9 --spp 1 --device";

/// Runs the program without any Vulkan driver.
#[cfg(target_os = "linux")]
fn without_drivers(folder: &Folder, line: &str) -> Run {
    folder.run_with(line, &[("VK_DRIVER_FILES", "/nonexistent.json"), ("VK_ICD_FILENAMES", "/nonexistent.json")])
}

#[test]
#[cfg(target_os = "linux")]
fn without_an_adapter_auto_selects_the_cpu_and_others_fail() {
    let folder = Folder::with_small();
    folder.write("rays.csv", "0,0,1,0,0,-1,inf\n");
    for device in ["gpu", "both", "both:llvmpipe", "llvmpipe"] {
        let words = ["no adapter", "driver for Vulkan", "--device cpu"];
        without_drivers(&folder, &format!("{RENDER} {device}")).refused(&words);
    }
    without_drivers(&folder, "cast small.obj --rays rays.csv --hits hits.csv --device gpu").refused(&["no adapter"]);
    assert_eq!(folder.names(), ["rays.csv", "small.obj"]);
    let run = without_drivers(&folder, &format!("{RENDER} auto --json")).done();
    assert_eq!((run.stderr.as_str(), &run.json()["device"]), ("", &"cpu".into()));
}

#[test]
fn an_unknown_name_is_rejected_with_the_available_ones() {
    let Some(name) = adapter("an_unknown_name_is_rejected_with_the_available_ones") else { return };
    let folder = Folder::with_small();
    folder.run(&format!("{RENDER} abacus")).refused(&["'abacus'", &name]);
    folder.run(&format!("{RENDER} both:abacus")).refused(&["'abacus'", &name]);
    folder.run(&format!("{RENDER} both:")).refused(&["--device", "both:"]);
    assert_eq!(folder.names(), ["small.obj"]);
}

#[test]
fn a_name_selects_its_adapter_and_a_software_driver_is_reported_once() {
    let Some(name) = adapter("a_name_selects_its_adapter_and_a_software_driver_is_reported_once") else { return };
    let folder = Folder::with_small();
    let is_software = folder.run("devices --json").done().json()["adapters"][0]["is_software"] == true;
    let part = name.split_whitespace().next().unwrap_or_default().to_uppercase();
    for device in ["gpu", &part] {
        let run = folder.run(&format!("{RENDER} {device} --json")).done();
        assert_eq!(run.json()["device"], *name);
        assert_eq!(run.n_warnings(), usize::from(is_software), "{}", run.stderr);
    }
}

#[test]
fn unsupported_requests_are_rejected() {
    let Some(_) = adapter("unsupported_requests_are_rejected") else { return };
    let folder = Folder::with_small();
    folder.write("rays.csv", "0,0,1,0,0,-1,inf\n");
    folder.write("far.obj", crate::support::SMALL.replace("v 1 0 0", "v 2e18 0 0"));
    let cast = "cast small.obj --rays rays.csv --hits hits.csv --device";
    folder.write(
        "coat.toml",
        "[[assets]]\nname = \"small\"\nfile = \"small.obj\"\nmaterial = \"coat\"\n\n\
         [[materials]]\nname = \"coat\"\nclearcoat = 0.5\n",
    );
    let coat = format!("{RENDER} gpu --integrator").replace("small.obj", "coat.toml");
    let cases = [
        (format!("{coat} path"), "clear coats"),
        (format!("{coat} hybrid --aovs albedo").replace("a.png", "a.exr"), "clear coats"),
        (format!("{RENDER} gpu --volumes aabb --builder ploc"), "--builder ploc with a binary BVH is not supported"),
        (format!("{RENDER} gpu --accel kdtree"), "--accel kdtree is not supported on the GPU"),
        (format!("{RENDER} gpu --triangles baldwin-weber"), "--triangles baldwin-weber is not supported"),
        (format!("{RENDER} gpu --heatmap boxes"), "--heatmap is not supported on the GPU"),
        (format!("{RENDER} gpu").replace("small.obj", "far.obj"), "coordinates above 1e18"),
        (format!("{RENDER} gpu --levels two").replace("small.obj", "far.obj"), "coordinates above 1e18"),
        (format!("{cast} gpu").replace("small.obj", "far.obj"), "coordinates above 1e18"),
        (format!("{cast} gpu --accel bih"), "--accel bih is not supported"),
        (format!("{cast} gpu --triangles moller-trumbore"), "--triangles moller-trumbore is not supported"),
        (format!("{cast} both"), "--device both"),
        ("stats small.obj --device both".to_owned(), "--device both"),
    ];
    for (line, word) in cases {
        folder.run(&line).refused(&[word, "cpu"]);
    }
    assert_eq!(folder.names(), ["coat.toml", "far.obj", "rays.csv", "small.obj"]);
}
