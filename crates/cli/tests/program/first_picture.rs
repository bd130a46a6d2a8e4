//! What is chosen for a scene: light, integrator, camera; crops, exposure and formats.

use crate::support::Folder;

const LINE: &str = "--size 64x48 --spp 4 --device cpu";

/// A square of 2 x 2 around the origin of the plane z = 0.
const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";

fn mean(folder: &Folder, name: &str) -> f64 {
    let image = image::load_from_memory(&folder.bytes(name)).unwrap().to_rgb8();
    image.pixels().flat_map(|pixel| pixel.0).map(f64::from).sum::<f64>() / f64::from(3 * image.width() * image.height())
}

#[test]
fn weak_emission_keeps_the_default_light() {
    let folder = Folder::new();
    folder.write("weak.mtl", "newmtl a\nKd 0.5 0.5 0.5\nKe 0.001 0.001 0.001\n");
    folder.write("strong.mtl", "newmtl a\nKd 0.5 0.5 0.5\nKe 5 5 5\n");
    for name in ["weak", "strong"] {
        folder.write(&format!("{name}.obj"), format!("mtllib {name}.mtl\nusemtl a\n{SQUARE}"));
    }
    let weak = folder.run(&format!("weak.obj {LINE} --json")).done();
    assert!(weak.stderr.contains("note: added the default light"), "{}", weak.stderr);
    assert!(weak.json()["default_light"].is_number());
    assert!(mean(&folder, "weak.png") > 60.0, "{}", mean(&folder, "weak.png"));
    let strong = folder.run(&format!("strong.obj {LINE} --json")).done();
    assert!(
        strong.stderr.starts_with("note: --exposure -2.6: ") && strong.stderr.lines().count() == 1,
        "{}",
        strong.stderr
    );
    assert!(strong.json()["default_light"].is_null());
    let dark = folder.run(&format!("weak.obj {LINE} --env 0,0,0")).done();
    assert!(dark.stderr.contains("% of the picture are black"), "{}", dark.stderr);
    let sequence =
        folder.run(&format!("render weak.obj {LINE} --env 0,0,0 --frames 0..3 --turntable 20 -o dark%d.png")).done();
    assert_eq!(sequence.stderr.matches("% of the picture are black").count(), 1, "{}", sequence.stderr);
}

#[test]
fn the_integrator_follows_the_materials() {
    let folder = Folder::new();
    folder.write(
        "a.mtl",
        "newmtl mirror\nillum 3\nKs 0.9 0.9 0.9\nnewmtl lamp\nKe 5 5 5\nnewmtl plain\nKd 0.5 0.5 0.5\n",
    );
    for (material, integrator) in [("mirror", "path"), ("lamp", "path"), ("plain", "hybrid")] {
        folder.write("a.obj", format!("mtllib a.mtl\nusemtl {material}\n{SQUARE}"));
        let json = folder.run(&format!("a.obj {LINE} --json")).done().json();
        assert_eq!(json["integrator"], integrator, "{material}");
        let given = folder.run(&format!("a.obj {LINE} --json --integrator hybrid")).done().json();
        assert_eq!((&given["integrator"], &given["integrator_reason"]), (&"hybrid".into(), &"given".into()));
    }
}

/// Lights in physical units would leave a white picture; linear formats, scene files and given exposures are as they are.
#[test]
fn the_exposure_follows_lights_of_the_file() {
    let folder = Folder::new();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/files/gltf/bright.gltf");
    let exposed = folder.run(&format!("render {file} {LINE} -o a.png")).done();
    assert!(exposed.stderr.contains("note: --exposure -9.") && exposed.stderr.contains("white"), "{}", exposed.stderr);
    let (seen, white) =
        (mean(&folder, "a.png"), folder.run(&format!("render {file} {LINE} -o b.png --exposure 0")).done());
    assert_eq!(white.stderr, "");
    // Most of the picture is background.
    assert!(seen > 15.0 && seen + 3.0 < mean(&folder, "b.png"), "{seen} {}", mean(&folder, "b.png"));
    assert_eq!(folder.run(&format!("render {file} {LINE} -o a.exr")).done().stderr, "");
    assert_eq!(folder.run(&format!("render {file} --size 64x48 --heatmap boxes -o b.png")).done().stderr, "");
    let report = folder.run(&format!("render {file} {LINE} -o b.png --json")).done().json();
    assert!(report["exposure"].as_f64().is_some_and(|stops| (-10.0..-9.0).contains(&stops)), "{report}");
    folder.run(&format!("scene {file} --size 64x48 --spp 4 -o a.toml")).done();
    let again = folder.run("render a.toml --device cpu -o c.png").done();
    assert!(again.stderr.is_empty() && folder.bytes("c.png") == folder.bytes("a.png"), "{}", again.stderr);
    // Nobody gave the option that the format ignores.
    assert_eq!(folder.run("render a.toml --device cpu -o c.exr").done().stderr, "");
}

/// White surfaces in the default light have shades.
#[test]
fn the_default_light_does_not_clip_white() {
    let folder = Folder::new();
    folder.write("white.mtl", "newmtl a\nKd 1 1 1\n");
    // It faces the sun.
    let square = "v -0.65 -0.97 0.83\nv 1.16 -0.12 0.83\nv 0.65 0.97 -0.83\nv -1.16 0.12 -0.83\nf 1 2 3 4\n";
    folder.write("white.obj", format!("mtllib white.mtl\nusemtl a\n{square}"));
    folder.run(&format!("white.obj {LINE}")).done();
    let image = image::load_from_memory(&folder.bytes("white.png")).unwrap().to_rgb8();
    assert!(image.pixels().all(|pixel| pixel.0 != [255; 3]));
}

/// A crop has the bits of the whole picture, at any place.
#[test]
fn crops_have_the_bits_of_the_whole() {
    let folder = Folder::with_small();
    let line = "render small.obj --size 100x70 --spp 4 --device cpu";
    folder.run(&format!("{line} -o whole.png")).done();
    let whole = image::load_from_memory(&folder.bytes("whole.png")).unwrap().to_rgb8();
    for [x, y, w, h] in [[0, 0, 100, 70], [33, 20, 40, 31], [99, 69, 1, 1]] {
        let json = folder.run(&format!("{line} -o crop.png --crop {x},{y},{w},{h} --json")).done().json();
        assert_eq!(json["size"], serde_json::json!([w, h]));
        let crop = image::load_from_memory(&folder.bytes("crop.png")).unwrap().to_rgb8();
        let part = image::imageops::crop_imm(&whole, x, y, w, h).to_image();
        assert!(crop == part, "{x},{y},{w},{h}");
    }
    folder.run(&format!("{line} -o crop.exr --crop 10,10,20,20 --aovs depth")).done();
    folder.run(&format!("{line} --crop 90,0,11,5")).refused(&["--crop 90,0,11,5", "100 x 70"]);
    folder.run(&format!("{line} --crop 0,0,0,5")).refused(&["--crop", "0,0,0,5"]);
    folder
        .run("render small.obj --size 100x70 -o a.exr --samples 0..2 --crop 0,0,5,5")
        .refused(&["--samples and --crop"]);
}

#[test]
fn cameras_are_chosen_by_name_and_number() {
    let folder = Folder::new();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/files/gltf/camera.gltf");
    let picture = |camera: &str| {
        folder.run(&format!("render {file} {LINE} -o a.png {camera}")).done();
        folder.bytes("a.png")
    };
    let first = picture("");
    assert!(first == picture("--camera front") && first == picture("--camera 0"));
    let flat = picture("--camera flat");
    assert!(flat == picture("--camera 1") && flat != first);
    // The second camera is orthographic and two units high.
    assert!(flat == picture("--camera front --ortho 2"));
    folder.run(&format!("render {file} --camera back")).refused(&["--camera back", "front, flat"]);
    folder.run("render --camera 1").refused(&["SCENE"]);
    folder.run(&format!("render {file} --ortho 2 --fov 30")).refused(&["--fov"]);
}

/// A scene with z up, framed for it, looks as the turned scene with y up.
#[test]
fn the_up_axis_turns_camera_and_light() {
    let folder = Folder::with_small();
    let turned: String = crate::support::SMALL
        .split('\n')
        .map(|line| {
            let words: Vec<&str> = line.split(' ').collect();
            // x, y, z with y up is x, -z, y with z up.
            match words[..] {
                ["v", x, y, z] => format!("v {x} {} {y}\n", if z == "0" { "0" } else { "-1" }),
                _ => format!("{line}\n"),
            }
        })
        .collect();
    folder.write("turned.obj", turned);
    folder.run(&format!("small.obj {LINE}")).done();
    folder.run(&format!("turned.obj {LINE} --up-axis z")).done();
    folder.run(&format!("turned.obj {LINE} --up 0,0,1 -o up.png")).done();
    let difference = |name: &str| (mean(&folder, "small.png") - mean(&folder, name)).abs();
    assert!(difference("turned.png") < 1.0 && difference("up.png") < 1.0);
    let [a, b] =
        ["small.png", "turned.png"].map(|name| image::load_from_memory(&folder.bytes(name)).unwrap().to_rgb8());
    let n_far = a.pixels().zip(b.pixels()).filter(|(a, b)| a.0[0].abs_diff(b.0[0]) > 40).count();
    assert!(n_far < 64 * 48 / 50, "{n_far} pixels differ");
}

#[test]
fn exposure_and_curves_change_encoded_formats_only() {
    let folder = Folder::with_small();
    let picture = |name: &str, options: &str| {
        let run = folder.run(&format!("render small.obj {LINE} -o {name} {options}")).done();
        (folder.bytes(name), run.n_warnings())
    };
    let (plain, linear) = (picture("a.png", "").0, picture("a.exr", "").0);
    assert_eq!(picture("a.png", "--exposure 0 --tone-map none"), (plain.clone(), 0));
    for options in ["--exposure -1", "--tone-map agx", "--tone-map aces", "--tone-map filmic-neutral"] {
        assert!(picture("a.png", options).0 != plain, "{options}");
        assert_eq!(picture("a.exr", options), (linear.clone(), 1), "{options}");
    }
    let automatic = folder.run(&format!("render small.obj {LINE} -o a.png --exposure auto")).done();
    assert!(automatic.stderr.contains("note: --exposure auto: "), "{}", automatic.stderr);
    folder.run("render small.obj --exposure bright").refused(&["--exposure", "bright", "auto"]);
    folder.run("render small.obj --tone-map film").refused(&["--tone-map", "film", "filmic-neutral"]);
    for (name, start) in [("a.jpg", &b"\xff\xd8"[..]), ("a.webp", b"RIFF"), ("a.hdr", b"#?RADIANCE")] {
        assert!(picture(name, "").0.starts_with(start), "{name}");
    }
    assert!(picture("b.png", "--format png16").0.len() > plain.len());
}

/// Passes give the bits of one render, and a time limit ends them.
#[test]
fn passes_have_the_bits_of_the_whole() {
    let folder = Folder::with_small();
    let line = "render small.obj --size 64x48 --device cpu";
    for options in ["--spp 11", "--spp 5 --crop 9,9,20,20", "--spp 4 --sampler sobol"] {
        folder.run(&format!("{line} {options} -o a.png")).done();
        let json = folder.run(&format!("{line} {options} -o b.png --preview --json")).done().json();
        assert!(folder.bytes("a.png") == folder.bytes("b.png"), "{options}");
        assert_eq!(json["samples_per_pixel"].to_string(), options[6..].split(' ').next().unwrap());
    }
    let limited = folder.run(&format!("{line} --seconds 0.5 -o a.png --json")).done().json();
    assert!(limited["samples_per_pixel"].as_u64().unwrap() >= 1 && limited["seconds"].as_f64().unwrap() < 20.0);
    let short = folder.run(&format!("{line} --seconds 1e-9 -o a.png --json")).done().json();
    assert_eq!(short["samples_per_pixel"], 1);
    folder.run(&format!("{line} --preview --noise 0.1")).refused(&["--noise"]);
    folder.run(&format!("{line} --seconds 0")).refused(&["--seconds", "0"]);
}
