//! `--device`: pictures match those of the CPU, and unsupported requests are rejected.
//!
//! Not covered: machines with both hardware and a software driver.

use std::process::Stdio;

use canted_fixtures::or_skip;

use crate::support::{Folder, Run};

/// The name of the best adapter. Without one, reports the test as skipped.
pub(crate) fn adapter(test: &str) -> Option<String> {
    let found = Folder::new().run("devices --json").done().json();
    let name = found["adapters"][0]["name"].as_str().map(str::to_owned);
    or_skip(test, name.ok_or("no adapter for device 'gpu'"))
}

// Pictures rendered on a GPU, parts and checkpoints.

const PICTURE: &str = "render small.obj --size 100x70 --env 0.5,0.7,1 --sun 0,-1,-1,2,2,2";

/// Relative mean squared error of pictures of 7000 pixels that differ by rounding only. Rounding sends a few of ten thousand
/// paths past an edge; of 16 samples per pixel, each such path adds at most 6e-7.
const SAME: f64 = 1e-5;

/// The relMSE of two pictures.
fn rel_mse(folder: &Folder, a: &str, b: &str) -> f64 {
    let found = folder.run(&format!("compare {a} {b} --json")).done().json();
    found["relmse"].as_f64().unwrap()
}

#[test]
fn a_gpu_renders_the_picture_of_the_cpu() {
    let Some(name) = adapter("a_gpu_renders_the_picture_of_the_cpu") else { return };
    let folder = Folder::with_small();
    // The last BVHs are built on the device.
    let all_options = [
        "--spp 16",
        "--builder lbvh --levels two --spp 16",
        "--builder ploc --integrator path --spp 16",
        "--spp 64 --noise 0.05",
        "--sampler sobol --spp 16 --filter tent",
        "--volumes pca-bounded --spp 16",
        "--volumes aabb --levels two --integrator path --spp 16",
    ];
    for options in all_options {
        folder.run(&format!("{PICTURE} {options} -o cpu.exr --device cpu")).done();
        let run = folder.run(&format!("{PICTURE} {options} -o gpu.exr --device gpu --json")).done().json();
        assert_eq!(run["device"], *name);
        let part = name.split_whitespace().next().unwrap_or_default();
        let both = folder.run(&format!("{PICTURE} {options} -o both.exr --device both:{part} --json")).done().json();
        assert_eq!(both["device"], format!("cpu and {name}"));
        assert!(both["gpu_tiles"].as_u64().unwrap() <= 12, "{both}");
        for picture in ["gpu.exr", "both.exr"] {
            let found = rel_mse(&folder, picture, "cpu.exr");
            assert!(found < SAME, "{options}: {picture}: {found}");
        }
        // The comparison detects another seed.
        folder.run(&format!("{PICTURE} {options} -o other.exr --device cpu --seed 1")).done();
        assert!(rel_mse(&folder, "other.exr", "cpu.exr") > SAME, "{options}");
    }
    folder.run(&format!("{PICTURE} --spp 1 -o gpu.png --device gpu")).done();
}

#[test]
fn the_report_says_why_one_kernel_takes_each_sample() {
    let Some(_) = adapter("the_report_says_why_one_kernel_takes_each_sample") else { return };
    let folder = Folder::with_small();
    folder.write("lines.obj", "v 0 0 0\nv 4 0 0\nv 8 0 0\nl 1 2 3\n");
    let of_lines = "render lines.obj --line-radius 0.5 --size 8x8";
    for (picture, reason) in [
        (format!("{PICTURE} --integrator path"), None),
        (format!("{PICTURE} --integrator hybrid --aovs direct,indirect,shadow"), None),
        (format!("{PICTURE} --integrator hybrid --first-hit raster"), Some("a raster pass")),
        (format!("{PICTURE} --integrator path --bounces 63"), Some("more than 64 rounds of rays")),
        (of_lines.to_owned(), Some("curves or patches")),
    ] {
        let run = folder.run(&format!("{picture} --spp 1 -o a.exr --device gpu --json")).done().json();
        assert_eq!(run.get("gpu_without_streams").and_then(|reason| reason.as_str()), reason, "{picture}: {run}");
    }
    let text = folder.run(&format!("{of_lines} --spp 1 -o a.exr --device gpu -v")).done().stdout;
    let is_reason = |line: &str| line.starts_with("gpu without streams ") && line.ends_with(" curves or patches");
    assert!(text.lines().any(is_reason), "{text}");
}

#[test]
fn parts_of_one_device_merge_and_those_of_two_do_not() {
    let Some(name) = adapter("parts_of_one_device_merge_and_those_of_two_do_not") else { return };
    let folder = Folder::with_small();
    let part = |range: &str, device: &str| {
        let file = format!("{device}-{}.exr", range.replace("..", "-"));
        folder.run(&format!("{PICTURE} --samples {range} --device {device} -o {file}")).done();
        file
    };
    let [all, start, end] = ["0..8", "0..3", "3..8"].map(|range| part(range, "gpu"));
    folder.run(&format!("merge {end} {start} -o merged.exr")).done();
    assert!(folder.bytes("merged.exr") == folder.bytes(&all));
    let other = part("3..8", "cpu");
    folder.run(&format!("merge {start} {other} -o mixed.exr")).refused(&["device", "cpu", &name]);
    let part = name.split_whitespace().next().unwrap_or_default();
    folder.run(&format!("{PICTURE} --samples 0..3 --device both:{part} -o both.exr")).refused(&["--samples", "both"]);
    assert!(!folder.names().iter().any(|name| name == "mixed.exr" || name == "both.exr"));
}

#[cfg(unix)]
mod interrupted {
    use std::{process::Child, thread::sleep, time::Duration};

    use super::*;
    use crate::process::{catches, interrupt, is_ignored, wait_until};

    fn start(folder: &Folder, line: &str) -> Child {
        let child = folder.command(line).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        wait_until(|| catches("INT", &child).unwrap_or(true));
        child
    }

    #[test]
    fn ctrl_c_leaves_a_whole_picture() {
        if is_ignored("ctrl_c_leaves_a_whole_picture") {
            return;
        }
        let mut devices = vec!["cpu"];
        devices.extend(adapter("ctrl_c_leaves_a_whole_picture").map(|_| "gpu"));
        for device in devices {
            let folder = interrupted(&format!("--size 1024x1024 --device {device}"), "out.png");
            let picture = image::open(folder.path("out.png")).unwrap().into_rgb8();
            assert_eq!(picture.dimensions(), (1024, 1024));
            // The environment is white all around.
            assert!(picture.pixels().all(|pixel| pixel.0 != [0; 3]), "{device}");
        }
    }

    #[test]
    fn ctrl_c_writes_additional_channels_too() {
        if is_ignored("ctrl_c_writes_additional_channels_too") {
            return;
        }
        let bytes = interrupted("--size 512x512 --device cpu --aovs normal", "out.exr").bytes("out.exr");
        assert!(bytes.windows(4).any(|name| name == b"N.Z\0"), "no normal channel");
        interrupted("--size 256x256 --seconds 1e20", "out.png");
        interrupted("--size 128x128 --preview --denoise", "out.png");
    }

    /// Interrupts a picture that takes long, before its first tile is finished.
    fn interrupted(options: &str, output: &str) -> Folder {
        let folder = Folder::with_small();
        let line = format!("render small.obj --spp 65536 --env 1,1,1 -o {output} {options}");
        let mut child = start(&folder, &line);
        // The scene is read by then.
        sleep(Duration::from_secs(3));
        assert_eq!(interrupt(&mut child), Some(130));
        assert_eq!(folder.names(), [output, "small.obj"], "{options}");
        folder
    }

    #[test]
    fn a_checkpoint_continues_on_the_same_device_only() {
        if is_ignored("a_checkpoint_continues_on_the_same_device_only") {
            return;
        }
        let Some(name) = adapter("a_checkpoint_continues_on_the_same_device_only") else { return };
        let folder = Folder::with_small();
        let line = format!("{PICTURE} --spp 512 -o out.exr --device gpu");
        folder.run(&line).done();
        let expected = folder.bytes("out.exr");
        std::fs::remove_file(folder.path("out.exr")).unwrap();
        let line = format!("{line} --checkpoint work.ckpt --checkpoint-every 0");
        let mut child = start(&folder, &line);
        wait_until(|| folder.path("work.ckpt").exists());
        assert_eq!(interrupt(&mut child), Some(130));
        assert_eq!(folder.names(), ["small.obj", "work.ckpt"]);
        folder.run(&line.replace("--device gpu", "--device cpu")).refused(&["work.ckpt", "device", &name]);
        folder.run(&line).done();
        assert!(folder.bytes("out.exr") == expected);
        assert_eq!(folder.names(), ["out.exr", "small.obj"]);
    }
}

// Device selection, and messages where there is none.

const DEVICES: &str = "render small.obj -o a.png --size 16x9 --spp 1 --device";

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
        without_drivers(&folder, &format!("{DEVICES} {device}")).refused(&words);
    }
    without_drivers(&folder, "cast small.obj --rays rays.csv --hits hits.csv --device gpu").refused(&["no adapter"]);
    assert_eq!(folder.names(), ["rays.csv", "small.obj"]);
    let run = without_drivers(&folder, &format!("{DEVICES} auto --json")).done();
    assert_eq!((run.stderr.as_str(), &run.json()["device"]), ("", &"cpu".into()));
}

/// Compiled pipelines are kept in the user's caches; a damaged file is replaced, and a folder that cannot be written does no harm.
#[test]
#[cfg(target_os = "linux")]
fn pipelines_are_kept_between_runs() {
    let Some(_) = adapter("pipelines_are_kept_between_runs") else { return };
    let folder = Folder::with_small();
    let caches = folder.path("caches");
    let render = |caches: &str| {
        folder.run_with(&format!("{DEVICES} gpu"), &[("XDG_CACHE_HOME", caches)]).done();
        folder.bytes("a.png")
    };
    let kept = || {
        let kept = std::fs::read_dir(caches.join("canted/pipelines")).unwrap().map(|entry| entry.unwrap().path());
        let [file] = <[_; 1]>::try_from(kept.collect::<Vec<_>>()).unwrap();
        (std::fs::read(&file).unwrap(), file)
    };
    let picture = render(caches.to_str().unwrap());
    let (bytes, file) = kept();
    assert!(bytes.starts_with(b"CANTEDP1"));
    for damage in [&bytes[..bytes.len() - 1], b"", b"CANTEDP1 and no more"] {
        std::fs::write(&file, damage).unwrap();
        assert!(render(caches.to_str().unwrap()) == picture);
        assert!(kept().0.starts_with(b"CANTEDP1") && kept().0.len() >= 16, "{} bytes", damage.len());
    }
    assert!(render("/dev/null/caches") == picture);
}

#[test]
fn an_unknown_name_is_rejected_with_the_available_ones() {
    let Some(name) = adapter("an_unknown_name_is_rejected_with_the_available_ones") else { return };
    let folder = Folder::with_small();
    folder.run(&format!("{DEVICES} abacus")).refused(&["'abacus'", &name]);
    folder.run(&format!("{DEVICES} both:abacus")).refused(&["'abacus'", &name]);
    folder.run(&format!("{DEVICES} both:")).refused(&["--device", "both:"]);
    assert_eq!(folder.names(), ["small.obj"]);
}

#[test]
fn a_name_selects_its_adapter_and_a_software_driver_is_reported_once() {
    let Some(name) = adapter("a_name_selects_its_adapter_and_a_software_driver_is_reported_once") else { return };
    let folder = Folder::with_small();
    let is_software = folder.run("devices --json").done().json()["adapters"][0]["is_software"] == true;
    let part = name.split_whitespace().next().unwrap_or_default().to_uppercase();
    for device in ["gpu", &part] {
        let run = folder.run(&format!("{DEVICES} {device} --json")).done();
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
         [[materials]]\nname = \"coat\"\nclearcoat = 0.5\nspecular_color = [1, 0.5, 0.5]\n",
    );
    let coat = format!("{DEVICES} gpu --integrator").replace("small.obj", "coat.toml");
    let cases = [
        (format!("{coat} path"), "clear coats"),
        (format!("{coat} hybrid --aovs albedo").replace("a.png", "a.exr"), "clear coats"),
        (format!("{DEVICES} gpu --volumes aabb --builder ploc"), "--builder ploc with a binary BVH is not supported"),
        (format!("{DEVICES} gpu --accel kdtree"), "--accel kdtree is not supported on the GPU"),
        (format!("{DEVICES} gpu --triangles baldwin-weber"), "--triangles baldwin-weber is not supported"),
        (format!("{DEVICES} gpu --heatmap boxes"), "--heatmap is not supported on the GPU"),
        (format!("{DEVICES} gpu").replace("small.obj", "far.obj"), "coordinates above 1e18"),
        (format!("{DEVICES} gpu --levels two").replace("small.obj", "far.obj"), "coordinates above 1e18"),
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

// `canted stats --device`: GPU buffers and build times.

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
    assert!(has("triangles") && has("sky_texels") && !has("texels_0") && !has("emitters"), "{names:?}");
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

// `--sums device`: the pictures of `--sums host`, from fewer bytes.

const SUMS: &str = "render small.obj --size 45x30 --env 0.5,0.7,1 --sun 0,-1,-1,2,2,2";

#[test]
fn the_device_sums_samples_for_every_kind_of_picture() {
    let Some(name) = adapter("the_device_sums_samples_for_every_kind_of_picture") else { return };
    let part = name.split_whitespace().next().unwrap_or_default();
    let folder = Folder::with_small();
    for options in [
        "--spp 64 --device gpu",
        "--spp 100 --device gpu",
        "--spp 64 --noise 0.05 --device gpu",
        "--spp 7 --sampler sobol --filter mitchell --integrator path --device gpu",
        "--samples 3..70 --aovs depth,normal --device gpu",
        "--spp 16 --crop 10,10,20,9 --denoise --device gpu",
        &format!("--spp 32 --device both:{part}"),
    ] {
        let [host, device] = ["host", "device"]
            .map(|sums| folder.run(&format!("{SUMS} {options} --sums {sums} -o {sums}.exr --json")).done().json());
        if options.contains("both") {
            // CPU and device share the tiles in another way.
            let found = folder.run("compare host.exr device.exr --json").done().json();
            assert!(found["relmse"].as_f64().unwrap() < 1e-5, "{options}: {found}");
        } else {
            assert!(folder.bytes("host.exr") == folder.bytes("device.exr"), "{options}");
        }
        assert_eq!(host["dropped_samples"], device["dropped_samples"]);
        let bytes = [&host, &device].map(|run| run["gpu_downloaded_bytes"].as_u64().unwrap());
        if ["--spp 64 --device gpu", "--spp 100 --device gpu"].contains(&options) {
            // Sixteen bytes for each sample of each cell of 8 x 8 pixels, or 64 for each pixel.
            let n_pixels = 48 * 32;
            assert!(bytes[0] >= 16 * 64 * n_pixels, "{host}");
            assert!(bytes[1] >= 64 * n_pixels && bytes[1] < 64 * n_pixels + 20_000, "{device}");
            // Another seed is another picture.
            folder.run(&format!("{SUMS} {options} --seed 1 --sums device -o other.exr")).done();
            assert!(folder.bytes("host.exr") != folder.bytes("other.exr"));
        }
    }
}

#[test]
fn parts_merge_wherever_they_are_summed() {
    let Some(_) = adapter("parts_merge_wherever_they_are_summed") else { return };
    let folder = Folder::with_small();
    let part = |range: &str, sums: &str, file: &str| {
        folder.run(&format!("{SUMS} --samples {range} --device gpu --sums {sums} -o {file}")).done();
    };
    part("0..68", "device", "all.exr");
    part("0..37", "device", "start.exr");
    part("37..68", "host", "end.exr");
    folder.run("merge start.exr end.exr -o merged.exr").done();
    assert!(folder.bytes("merged.exr") == folder.bytes("all.exr"));
}

#[test]
fn the_cpu_refuses_sums_of_a_device() {
    let folder = Folder::with_small();
    folder.run(&format!("{SUMS} --device cpu --sums device -o out.png")).refused(&["--sums device", "--device gpu"]);
    folder.run(&format!("{SUMS} --sums tree -o out.png")).refused(&["tree", "host", "device"]);
    folder.run("scene small.obj --sums device -o out.toml").refused(&["--sums", "canted render"]);
    assert_eq!(folder.names(), ["small.obj"]);
}
