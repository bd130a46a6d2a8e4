//! Pictures rendered on a GPU, parts and checkpoints.

use std::process::Stdio;

use crate::support::Folder;

use super::adapter;

const RENDER: &str = "render small.obj --size 100x70 --env 0.5,0.7,1 --sun 0,-1,-1,2,2,2";

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
        folder.run(&format!("{RENDER} {options} -o cpu.exr --device cpu")).done();
        let run = folder.run(&format!("{RENDER} {options} -o gpu.exr --device gpu --json")).done().json();
        assert_eq!(run["device"], *name);
        let part = name.split_whitespace().next().unwrap_or_default();
        let both = folder.run(&format!("{RENDER} {options} -o both.exr --device both:{part} --json")).done().json();
        assert_eq!(both["device"], format!("cpu and {name}"));
        assert!(both["gpu_tiles"].as_u64().unwrap() <= 12, "{both}");
        for picture in ["gpu.exr", "both.exr"] {
            let found = rel_mse(&folder, picture, "cpu.exr");
            assert!(found < SAME, "{options}: {picture}: {found}");
        }
        // The comparison detects another seed.
        folder.run(&format!("{RENDER} {options} -o other.exr --device cpu --seed 1")).done();
        assert!(rel_mse(&folder, "other.exr", "cpu.exr") > SAME, "{options}");
    }
    folder.run(&format!("{RENDER} --spp 1 -o gpu.png --device gpu")).done();
}

#[test]
fn parts_of_one_device_merge_and_those_of_two_do_not() {
    let Some(name) = adapter("parts_of_one_device_merge_and_those_of_two_do_not") else { return };
    let folder = Folder::with_small();
    let part = |range: &str, device: &str| {
        let file = format!("{device}-{}.exr", range.replace("..", "-"));
        folder.run(&format!("{RENDER} --samples {range} --device {device} -o {file}")).done();
        file
    };
    let [all, start, end] = ["0..8", "0..3", "3..8"].map(|range| part(range, "gpu"));
    folder.run(&format!("merge {end} {start} -o merged.exr")).done();
    assert!(folder.bytes("merged.exr") == folder.bytes(&all));
    let other = part("3..8", "cpu");
    folder.run(&format!("merge {start} {other} -o mixed.exr")).refused(&["device", "cpu", &name]);
    let part = name.split_whitespace().next().unwrap_or_default();
    folder.run(&format!("{RENDER} --samples 0..3 --device both:{part} -o both.exr")).refused(&["--samples", "both"]);
    assert!(!folder.names().iter().any(|name| name == "mixed.exr" || name == "both.exr"));
}

#[cfg(unix)]
mod interrupted {
    use std::{process::Child, thread::sleep, time::Duration};

    use super::*;
    use crate::interrupted::{catches, interrupt, is_ignored, wait_until};

    fn start(folder: &Folder, line: &str) -> Child {
        let child = folder.command(line).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        wait_until(|| catches("INT", &child).unwrap_or(true));
        child
    }

    #[test]
    fn ctrl_c_writes_the_finished_tiles() {
        if is_ignored("ctrl_c_writes_the_finished_tiles") {
            return;
        }
        let mut devices = vec!["cpu"];
        devices.extend(adapter("ctrl_c_writes_the_finished_tiles").map(|_| "gpu"));
        for device in devices {
            let folder = interrupted(&format!("--device {device}"), "out.png");
            let picture = image::open(folder.path("out.png")).unwrap().into_rgb8();
            assert_eq!(picture.dimensions(), (2048, 2048));
            let n_done = picture.pixels().filter(|pixel| pixel.0 != [0; 3]).count();
            assert!(n_done > 0 && n_done < 2048 * 2048, "{device}: {n_done} pixels are done");
        }
    }

    #[test]
    fn ctrl_c_writes_additional_channels_too() {
        if is_ignored("ctrl_c_writes_additional_channels_too") {
            return;
        }
        let bytes = interrupted("--device cpu --aovs normal", "out.exr").bytes("out.exr");
        assert!(bytes.windows(4).any(|name| name == b"N.Z\0"), "no normal channel");
    }

    /// Interrupts a large picture after at least one tile.
    fn interrupted(options: &str, output: &str) -> Folder {
        let folder = Folder::with_small();
        let line = format!("render small.obj --size 2048x2048 --spp 128 --env 1,1,1 -o {output} {options}");
        // Retries later, because the time of a tile is unknown and no picture is written before the first.
        for seconds in [1, 4, 16, 64] {
            let mut child = start(&folder, &line);
            sleep(Duration::from_secs(seconds));
            assert_eq!(interrupt(&mut child), Some(130));
            if folder.path(output).exists() {
                break;
            }
        }
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
        let line = format!("{RENDER} --spp 512 -o out.exr --device gpu");
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
