//! `--denoise`.

use std::thread::sleep;
use std::time::Duration;

use canted_film::{Picture, read_picture};
use serde_json::Value;

use crate::process::{interrupt, is_ignored};
use crate::support::Folder;

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/cornell.toml");
const FOCUS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/focus.toml");

/// The built-in scene, a room with glass and a mirror, and a scene out of focus.
fn scenes() -> [String; 3] {
    ["--integrator path".to_owned(), format!("{CORNELL} --sampler sobol"), FOCUS.to_owned()]
}

fn rel_mse(folder: &Folder, picture: &str) -> f64 {
    let found: Value = folder.run(&format!("compare {picture} reference.exr --json")).json();
    found["relmse"].as_f64().unwrap()
}

/// At 4 and 16 samples the error fell to 0.55 and 0.67 of it in the built-in scene, to 0.06 and 0.14 in the room, and to 0.21 and 0.43 out of
/// focus.
#[test]
fn the_error_falls_on_every_scene() {
    let folder = Folder::new();
    for scene in scenes() {
        let render = format!("render {scene} --device cpu --size 64x64");
        folder.run(&format!("{render} --spp 512 --seed 1 -o reference.exr")).done();
        for (spp, ratio) in [(4, 1.5), (16, 1.25)] {
            folder.run(&format!("{render} --spp {spp} -o noisy.exr")).done();
            folder.run(&format!("{render} --spp {spp} --denoise -o clean.exr")).done();
            let [noisy, clean] = ["noisy.exr", "clean.exr"].map(|name| rel_mse(&folder, name));
            assert!(ratio * clean < noisy, "{scene}, {spp} samples: {noisy} -> {clean}");
        }
    }
}

/// Formats of 8 bits, below 64 samples per pixel; and the option may stand before the file, without a value.
#[test]
fn pictures_of_few_samples_are_filtered_by_default() {
    let folder = Folder::new();
    for (spp, name, default) in
        [(4, "a.png", "on"), (63, "a.jpg", "on"), (64, "a.png", "off"), (4, "a.exr", "off"), (4, "a.hdr", "off")]
    {
        let bytes = |option: &str| {
            folder.run(&format!("render {option} {CORNELL} --device cpu --size 24x20 --spp {spp} -o {name}")).done();
            folder.bytes(name)
        };
        let [by_default, on, off] = ["", "--denoise", "--denoise off"].map(bytes);
        assert_eq!(on, bytes("--denoise on"), "{name}");
        assert_ne!(on, off, "{name}");
        assert_eq!(by_default, if default == "on" { on } else { off }, "{name}, {spp} samples");
    }
    folder.run("render --denoise maybe -o b.png").refused(&["maybe"]);
}

fn pixels(folder: &Folder, name: &str) -> Picture {
    read_picture(&folder.path(name)).unwrap()
}

#[test]
fn threads_crops_passes_and_parts_give_the_same_bits() {
    let folder = Folder::new();
    let render = format!("render {CORNELL} --device cpu --size 200x180 --spp 2 --denoise");
    folder.run(&format!("{render} --threads 1 -o whole.exr")).done();
    let whole = pixels(&folder, "whole.exr");
    folder.run(&format!("{render} --threads 3 -o b.exr")).done();
    assert_eq!(folder.bytes("whole.exr"), folder.bytes("b.exr"));
    folder.run(&format!("{render} --crop 150,5,30,20 -o crop.exr")).done();
    assert_eq!(pixels(&folder, "crop.exr"), whole.cropped([150, 5], [30, 20]));
    folder.run(&format!("{render} --preview -o preview.exr")).done();
    assert_eq!(pixels(&folder, "preview.exr"), whole);
    let part = format!("render {CORNELL} --device cpu --size 200x180 --aovs albedo --samples");
    folder.run(&format!("{part} 0..1 -o p0.exr")).done();
    folder.run(&format!("{part} 1..2 -o p1.exr")).done();
    folder.run("merge p0.exr p1.exr -o merged.exr --denoise").done();
    assert_eq!(pixels(&folder, "merged.exr"), whole);
    // The sums are not filtered.
    folder.run("merge p0.exr p1.exr -o sums.exr").done();
    folder.run("merge merged.exr -o again.exr").done();
    assert_eq!(folder.bytes("again.exr"), folder.bytes("sums.exr"));
}

#[test]
fn channels_stay_and_frames_are_filtered() {
    let folder = Folder::new();
    let render = "render --device cpu --size 40x30 --spp 2";
    folder.run(&format!("{render} --aovs all -o noisy.exr")).done();
    folder.run(&format!("{render} --aovs all --denoise -o clean.exr")).done();
    assert_ne!(pixels(&folder, "noisy.exr"), pixels(&folder, "clean.exr"));
    let channel = |name: &str, channel: &str| {
        let image = exr_channel(&folder, name, channel);
        assert_eq!(image.len(), 40 * 30);
        image
    };
    for name in ["Z", "Ns.X", "albedo.G", "N.Z"] {
        assert_eq!(channel("noisy.exr", name), channel("clean.exr", name), "{name}");
    }
    let turn = format!("{render} --turntable 90 --frames 0..2 --denoise");
    folder.run(&format!("{turn} -o f%d.exr")).done();
    folder.run(&format!("{render} --denoise -o one.exr")).done();
    assert_eq!(pixels(&folder, "f0.exr"), pixels(&folder, "one.exr"));
    let frames = folder.run(&format!("{render} --turntable 90 --frames 0..2 --resume -o f%d.exr"));
    frames.refused(&["f0.exr", "differs from the picture of these options"]);
}

/// `emission`, `direct` and `indirect` add up to the picture of the samples, whatever lies between the camera and the light.
#[test]
fn light_in_parts_adds_up_to_the_picture_of_the_samples() {
    let folder = Folder::new();
    let parts = ["emission", "direct", "indirect"];
    let devices: &[&str] = match crate::gpu::adapter("light_in_parts_adds_up_to_the_picture_of_the_samples on gpu") {
        Some(_) => &["cpu", "gpu"],
        None => &["cpu"],
    };
    let numbers = |channel: &str| -> Vec<f32> {
        exr_channel(&folder, "a.exr", channel).into_iter().map(f32::from_bits).collect()
    };
    // The greatest difference of a channel, relative to numbers above 1.
    let apart = || {
        let differences = ["R", "G", "B"].map(|color| {
            let [emission, direct, indirect] = parts.map(|part| numbers(&format!("{part}.{color}")));
            let of_pixel =
                |(i, sum): (usize, f32)| (emission[i] + direct[i] + indirect[i] - sum).abs() / sum.abs().max(1.0);
            numbers(color).into_iter().enumerate().map(of_pixel).fold(0.0, f32::max)
        });
        differences.into_iter().fold(0.0, f32::max)
    };
    let cases = [
        "--integrator path",
        "--integrator hybrid",
        "--integrator path --background transparent --filter mitchell --clamp 0.5",
        "--integrator hybrid --ground on --background 0.5,0.5,0.5 --aperture 0.1",
    ];
    for device in devices {
        for options in cases {
            let render = format!("render --size 40x30 --spp 4 --device {device} {options}");
            folder.run(&format!("{render} --aovs emission,direct,indirect -o a.exr")).done();
            assert!(apart() < 1e-5, "{device} {options}: {}", apart());
            // Nothing shines into the camera before a transparent background.
            let first = usize::from(options.contains("transparent"));
            for part in &parts[first..] {
                let n_lit = numbers(&format!("{part}.G")).into_iter().filter(|&light| light > 0.0).count();
                assert!(n_lit > 20, "{device} {options}: {part} in {n_lit} pixels");
            }
        }
    }
    // One alone is written alone, and the filter changes the picture only.
    let render = "render --size 40x30 --spp 4 --device cpu --integrator path";
    folder.run(&format!("{render} --aovs emission,direct,indirect --denoise -o a.exr")).done();
    let filtered = apart();
    folder.run(&format!("{render} --aovs emission,direct,indirect -o a.exr")).done();
    assert!(filtered > 1e-3 && apart() < 1e-5, "{filtered}");
    let direct = numbers("direct.R");
    folder.run(&format!("{render} --aovs direct -o a.exr")).done();
    assert_eq!(numbers("direct.R"), direct);
    assert!(!folder.bytes("a.exr").windows(11).any(|name| name == b"\0indirect.R"));
}

/// What lights and sky would bring to the first surface, times what arrives of it, is direct light; `path` does not separate it.
#[test]
fn light_at_the_first_surface_multiplies_to_direct_light() {
    let folder = Folder::new();
    let render = "render --size 40x30 --spp 4 --device cpu";
    let names = "direct,diffuse,shadow,ambient,occlusion";
    let numbers = |channel: &str| -> Vec<f32> {
        exr_channel(&folder, "a.exr", channel).into_iter().map(f32::from_bits).collect()
    };
    // The integrator is chosen by the channels.
    folder.run(&format!("{render} --aovs {names} -o a.exr")).done();
    for color in ["R", "G", "B"] {
        let of = |name: &str| numbers(&format!("{name}.{color}"));
        let [direct, diffuse, shadow, ambient, occlusion] =
            ["direct", "diffuse", "shadow", "ambient", "occlusion"].map(of);
        let product = |i: usize| diffuse[i] * shadow[i] + ambient[i] * occlusion[i];
        assert!((0..direct.len()).all(|i| (product(i) - direct[i]).abs() < 1e-5 * direct[i].max(1.0)), "{color}");
        for factor in [shadow, occlusion] {
            assert!(factor.iter().any(|&x| x < 0.9) && factor.iter().all(|x| (0.0..=1.0).contains(x)), "{color}");
        }
    }
    // Parts keep the sums, so that the quotients of the whole are theirs.
    let part = |samples: &str, name: &str| {
        folder.run(&format!("render --size 40x30 --device cpu --samples {samples} --aovs {names} -o {name}")).done();
    };
    part("0..3", "1.exr");
    part("3..8", "2.exr");
    part("0..8", "whole.exr");
    folder.run("merge 2.exr 1.exr -o merged.exr").done();
    assert!(folder.bytes("merged.exr") == folder.bytes("whole.exr"));
    // `all` is what the integrator has.
    folder.run(&format!("{render} --integrator path --aovs all -o a.exr")).done();
    assert!(!folder.bytes("a.exr").windows(9).any(|name| name == b"\0shadow.R"));
    folder.run(&format!("{render} --integrator hybrid --aovs all -o a.exr")).done();
    assert!(numbers("shadow.R").iter().any(|&x| x < 1.0));
    let refused = folder.run(&format!("{render} --integrator path --aovs depth,shadow -o b.exr"));
    refused.refused(&["--aovs shadow requires --integrator hybrid"]);
}

/// The bits of a channel.
fn exr_channel(folder: &Folder, name: &str, channel: &str) -> Vec<u32> {
    use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
    let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let image = read.all_attributes().from_file(folder.path(name)).unwrap();
    let found = image.layer_data.channel_data.list.into_iter().find(|own| own.name == *channel).unwrap();
    match found.sample_data {
        FlatSamples::F32(values) => values.into_iter().map(f32::to_bits).collect(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_cannot_be_filtered_is_refused() {
    let folder = Folder::with_small();
    let render = "render small.obj --size 8x8 --spp 1 --device cpu";
    folder
        .run("render small.obj --size 8x8 --samples 0..2 --denoise -o a.exr")
        .refused(&["--samples", "merge --denoise"]);
    folder.run(&format!("{render} --heatmap boxes --denoise")).refused(&["--denoise", "--heatmap"]);
    folder.run("render small.obj --size 8x8 --device cpu --samples 0..2 -o p.exr").done();
    folder.run("merge p.exr -o m.exr --denoise").refused(&["p.exr", "--aovs albedo"]);
}

#[test]
fn limits_of_time_and_interruptions_leave_a_filtered_picture() {
    let folder = Folder::new();
    let render = format!("render {CORNELL} --device cpu --denoise");
    folder.run(&format!("{render} --size 64x64 --seconds 0.2 -o timed.png")).done();
    assert_eq!(pixels(&folder, "timed.png").width, 64);
    if is_ignored("limits_of_time_and_interruptions_leave_a_filtered_picture") {
        return;
    }
    for options in ["--preview", ""] {
        let line = format!("{render} {options} --size 256x256 --spp 65536 -o stopped.png");
        let mut child = folder.command(&line).stderr(std::process::Stdio::null()).spawn().unwrap();
        sleep(Duration::from_secs(if options.is_empty() { 6 } else { 3 }));
        assert_eq!(interrupt(&mut child), Some(130), "{options}");
        let names = folder.names();
        assert!(names.iter().all(|name| !name.ends_with(".tmp")), "{names:?}");
        if !options.is_empty() {
            assert!(pixels(&folder, "stopped.png").pixels.iter().any(|c| c[0] > 0.1), "the first passes are shown");
        }
    }
}
