//! `--sums device`: the pictures of `--sums host`, from fewer bytes.

use crate::support::Folder;

use super::adapter;

const RENDER: &str = "render small.obj --size 45x30 --env 0.5,0.7,1 --sun 0,-1,-1,2,2,2";

/// Relative mean squared error of sums that differ by six roundings of 2^-24, and of the picture's `f32`.
const ROUNDING: f64 = 1e-12;

#[test]
fn the_device_sums_samples_for_every_kind_of_picture() {
    let Some(name) = adapter("the_device_sums_samples_for_every_kind_of_picture") else { return };
    let part = name.split_whitespace().next().unwrap_or_default();
    let folder = Folder::with_small();
    for options in [
        "--spp 64 --device gpu",
        "--spp 64 --noise 0.05 --device gpu",
        "--spp 7 --sampler sobol --filter mitchell --integrator path --device gpu",
        "--samples 3..70 --aovs depth,normal --device gpu",
        "--spp 16 --crop 10,10,20,9 --denoise --device gpu",
        &format!("--spp 32 --device both:{part}"),
    ] {
        let [host, device] = ["host", "device"]
            .map(|sums| folder.run(&format!("{RENDER} {options} --sums {sums} -o {sums}.exr --json")).done().json());
        let found = folder.run("compare host.exr device.exr --json").done().json();
        // CPU and device share the tiles in another way, and round samples in another way.
        let bound = if options.contains("both") { 1e-5 } else { ROUNDING };
        assert!(found["relmse"].as_f64().unwrap() < bound, "{options}: {found}");
        assert_eq!(host["dropped_samples"], device["dropped_samples"]);
        let bytes = [&host, &device].map(|run| run["gpu_downloaded_bytes"].as_u64().unwrap());
        if options == "--spp 64 --device gpu" {
            // Sixteen bytes for each sample of each cell of 8 x 8 pixels, or forty for each pixel.
            let n_pixels = 48 * 32;
            assert!(bytes[0] >= 16 * 64 * n_pixels, "{host}");
            assert!(bytes[1] >= 40 * n_pixels && bytes[1] < 40 * n_pixels + 1000, "{device}");
            // Another seed is another picture.
            folder.run(&format!("{RENDER} {options} --seed 1 --sums device -o other.exr")).done();
            let other = folder.run("compare host.exr other.exr --json").done().json();
            assert!(other["relmse"].as_f64().unwrap() > 1e6 * ROUNDING, "{other}");
        }
    }
}

#[test]
fn parts_and_checkpoints_of_other_sums_are_refused() {
    let Some(_) = adapter("parts_and_checkpoints_of_other_sums_are_refused") else { return };
    let folder = Folder::with_small();
    let part = |range: &str, sums: &str, file: &str| {
        folder.run(&format!("{RENDER} --samples {range} --device gpu --sums {sums} -o {file}")).done();
    };
    part("0..68", "device", "all.exr");
    part("0..64", "device", "start.exr");
    part("64..68", "device", "end.exr");
    folder.run("merge start.exr end.exr -o merged.exr").done();
    assert!(folder.bytes("merged.exr") == folder.bytes("all.exr"));
    part("64..68", "host", "other.exr");
    folder.run("merge start.exr other.exr -o mixed.exr").refused(&["sums", "device"]);
    assert!(!folder.names().iter().any(|name| name == "mixed.exr"));
}

#[test]
fn the_cpu_refuses_sums_of_a_device() {
    let folder = Folder::with_small();
    folder.run(&format!("{RENDER} --device cpu --sums device -o out.png")).refused(&["--sums device", "--device gpu"]);
    folder.run(&format!("{RENDER} --sums tree -o out.png")).refused(&["tree", "host", "device"]);
    folder.run("scene small.obj --sums device -o out.toml").refused(&["--sums", "canted render"]);
    assert_eq!(folder.names(), ["small.obj"]);
}
