//! `canted render`: pictures and reports, the first picture of a file, and environment maps.

use std::path::PathBuf;

use canted_fixtures::skip;

use crate::support::{Folder, Run, rows};

const QUICK: &str = "render small.obj --size 48x27 --spp 2";

/// Width and height in the header of a PNG file.
fn png_size(bytes: &[u8]) -> [u32; 2] {
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
}

#[test]
fn pictures_have_the_requested_size_and_format() {
    let folder = Folder::with_small();
    let run = folder.run(&format!("{QUICK} -o out.png")).done();
    assert!(run.stdout.contains("48 x 27"), "{}", run.stdout);
    assert_eq!(png_size(&folder.bytes("out.png")), [48, 27]);
    folder.run(&format!("{QUICK} -o out.EXR")).done();
    assert_eq!(folder.bytes("out.EXR")[..4], [0x76, 0x2f, 0x31, 0x01]);
    folder.run("render small.obj --size 1x1 --spp 1").done();
    assert_eq!(png_size(&folder.bytes("canted.png")), [1, 1]);
}

/// Without -o, only pictures that the program wrote are replaced.
#[test]
fn files_of_others_are_not_replaced() {
    let folder = Folder::with_small();
    let line = "--size 8x8 --spp 1";
    for name in ["small.png", "canted.png"] {
        let command = if name == "small.png" { "small.obj" } else { "render small.obj" };
        // A photograph beside its scan.
        image::RgbImage::new(4, 4).save(folder.path(name)).unwrap();
        let before = folder.bytes(name);
        folder.run(&format!("{command} {line}")).refused(&[name, "not a picture that canted wrote", "-o", "--force"]);
        assert!(folder.bytes(name) == before);
        let run = folder.run(&format!("{command} {line} --force")).done();
        assert!(run.stdout.contains("the file that was there is replaced"), "{}", run.stdout);
        assert_eq!(png_size(&folder.bytes(name)), [8, 8]);
        folder.run(&format!("{command} {line}")).done();
        folder.write(name, &before);
        folder.run(&format!("{command} {line} -o {name}")).done();
        assert_eq!(png_size(&folder.bytes(name)), [8, 8]);
    }
}

#[test]
fn the_report_has_a_line_for_each_question() {
    let folder = Folder::with_small();
    let report = folder.run(&format!("{QUICK} -o out.png")).done().stdout;
    let names: Vec<&str> = report.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(names, ["picture", "scene", "camera", "light", "samples", "time"], "{report}");
    let all = folder.run(&format!("{QUICK} -o out.png -v")).done().stdout;
    assert!(all.lines().count() > 12 && all.contains("not needed"), "{all}");
    assert_eq!(folder.run(&format!("{QUICK} -o out.png -q")).done().stdout, "");
}

#[test]
fn the_report_is_available_as_json() {
    let folder = Folder::with_small();
    let facts = folder.run(&format!("{QUICK} --bounces 1 --threads 2 --json -o out.png")).done().json();
    assert_eq!(facts["size"], serde_json::json!([48, 27]));
    assert_eq!(facts["scene"], "small.obj");
    assert_eq!(facts["picture"], "out.png");
    assert_eq!((&facts["samples_per_pixel"], &facts["bounces"]), (&2.into(), &1.into()));
    assert_eq!((&facts["placed_triangles"], &facts["threads"]), (&3.into(), &2.into()));
    assert!(facts["rays"].as_u64().unwrap() >= 48 * 27 * 2, "one camera ray per sample: {}", facts["rays"]);
    assert!(facts["not_needed"].as_array().unwrap().iter().all(|unused| unused["part"].is_string()));
    for key in ["load_seconds", "build_seconds", "trace_seconds", "seconds"] {
        assert!(facts[key].as_f64().unwrap() >= 0.0, "{key}");
    }
    // Of both threads together.
    let stages = ["camera", "rays", "shading", "film"].map(|stage| facts[format!("{stage}_thread_seconds")].as_f64());
    let sum: f64 = stages.map(|seconds| seconds.filter(|&seconds| seconds > 0.0).unwrap()).iter().sum();
    assert!(sum <= 2.0 * facts["trace_seconds"].as_f64().unwrap(), "{facts}");
}

#[test]
fn the_report_describes_the_volumes() {
    let folder = Folder::with_small();
    let fact = |line: &str, key: &str| {
        let facts = folder.run(&format!("render {line} --size 8x5 --spp 1 --json -o out.png")).done().json();
        facts[key].as_str().unwrap_or_else(|| panic!("{line}: {facts}")).to_owned()
    };
    assert_eq!(fact("small.obj", "volumes"), "wide, leaves only");
    assert_eq!(fact("small.obj --levels two --preset quality", "volumes"), "wide, leaves only");
    assert_eq!(fact("small.obj --volumes aabb", "volumes"), "aabb");
    assert_eq!(fact("small.obj --volumes dop --builder sah", "volumes"), "dop");
    assert_eq!(fact("small.obj --accel bvh2", "volumes"), "aabb");
    assert_eq!(fact("small.obj --accel bih", "volumes"), "bounding intervals");
    assert_eq!(fact("small.obj --accel kdtree", "volumes"), "kd-tree cells");
    assert!(["scalar", "avx2", "avx512", "neon"].contains(&fact("small.obj", "simd").as_str()));
    assert!(fact("--aligned", "volumes").starts_with("wide, 0 of "));
    // The built-in scene has diagonal beams.
    for options in ["", "--preset fast", "--levels two", "--builder sah"] {
        let words = fact(options, "volumes");
        let numbers: Vec<u64> = words.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
        assert!(words.starts_with("wide, ") && words.contains(" nodes oriented"), "{options}: {words}");
        assert!(0 < numbers[0] && numbers[0] <= numbers[1], "{options}: {words}");
    }
}

#[test]
fn the_report_says_why_oriented_nodes_are_not_needed() {
    let folder = Folder::with_small();
    let reason = |line: &str| {
        let facts = folder.run(&format!("render {line} --size 8x5 --spp 1 --json -o out.png")).done().json();
        let parts = facts["not_needed"].as_array().unwrap();
        let oriented = parts.iter().find(|unused| unused["part"] == "oriented nodes");
        oriented.map(|unused| unused["reason"].as_str().unwrap().to_owned())
    };
    assert_eq!(reason("small.obj").as_deref(), Some("too little gain in predicted cost"));
    assert_eq!(reason("small.obj --volumes aabb").as_deref(), Some("axis-aligned boxes were requested"));
    assert_eq!(reason("--volumes aabb").as_deref(), Some("axis-aligned boxes were requested"));
    assert_eq!(reason(""), None, "the built-in scene has diagonal beams");
}

/// The reasons are those of the run, and nothing that an integrator uses is reported as not needed.
#[test]
fn reported_parts_are_not_needed() {
    let folder = Folder::with_small();
    let parts = |options: &str| -> Vec<(String, String)> {
        let facts =
            folder.run(&format!("render small.obj --size 8x5 --spp 1 --json -o out.png {options}")).done().json();
        let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
        facts["not_needed"].as_array().unwrap().iter().map(|u| (text(&u["part"]), text(&u["reason"]))).collect()
    };
    let has = |parts: &[(String, String)], part: &str, reason: &str| parts.contains(&(part.into(), reason.into()));
    assert!(has(&parts(""), "top-level BVH", "one level is predicted to cost rays less"));
    assert!(has(&parts("--levels one"), "top-level BVH", "one level was requested"));
    // Shadow rays sample the sky although the scene has no lights.
    let sky = parts("--integrator path --env 1,1,1");
    assert!(has(&sky, "listed lights", "the scene lists none"), "{sky:?}");
    assert!(!sky.iter().any(|(part, _)| part.contains("shadow")), "{sky:?}");
}

#[test]
fn threads_do_not_change_a_byte() {
    let folder = Folder::with_small();
    for options in ["--spp 4", "--spp 4 --env 1,1,1", "--spp 1 --heatmap boxes"] {
        for format in ["png", "exr"] {
            let picture = |n: u32| {
                let name = format!("out{n}.{format}");
                folder.run(&format!("render small.obj --size 70x50 {options} --threads {n} -o {name}")).done();
                folder.bytes(&name)
            };
            let one = picture(1);
            assert!((2..=4).all(|n| picture(n) == one), "{options}, {format}");
        }
    }
}

#[test]
fn structures_do_not_change_a_byte() {
    let folder = Folder::with_small();
    let picture = |options: &str| {
        folder.run(&format!("{QUICK} {options} -o out.exr")).done();
        folder.bytes("out.exr")
    };
    let first = picture("");
    for options in [
        "--levels two",
        "--volumes dop",
        "--levels two --volumes combined",
        #[cfg(feature = "baseline")]
        "--builder obvhs",
        "--builder auto",
        "--builder sah",
        "--builder sah --volumes aabb",
        "--builder sbvh",
        "--builder sbvh --accel bvh2",
        "--builder hlbvh",
        "--builder midpoint --accel bvh2",
        "--builder median",
        "--preset fast",
        "--preset dynamic",
        "--preset quality --levels two",
        "--accel wide",
        "--aligned",
        "--aligned=off --preset quality",
        "--accel bvh2",
        "--accel bvh2 --volumes dop --levels two",
        "--accel bih",
        "--accel bih --levels two",
        "--accel kdtree",
        "--accel kdtree --levels two",
    ] {
        assert!(picture(options) == first, "{options}");
    }
    assert!(picture("--seed 1") != first, "another seed gives other noise");
    assert!(picture("--fov 20") != first);
    assert!(picture("--eye 0.5,0.5,9 --target 0.5,0.5,0") != first);
}

#[test]
fn heat_maps_count_tests() {
    let folder = Folder::with_small();
    let camera = "--eye 0.5,0.5,9 --target 0.5,0.5,0 --fov 10 --volumes aabb";
    for what in ["boxes", "triangles"] {
        let facts = folder.run(&format!("{QUICK} --heatmap {what} {camera} --json -o {what}.png")).done().json();
        assert_eq!(png_size(&folder.bytes(&format!("{what}.png"))), [48, 27]);
        assert!(facts["box_tests_per_ray"].as_f64().unwrap() > 0.0);
        let triangles = facts["triangle_tests_per_ray"].as_f64().unwrap();
        assert!(triangles > 0.0 && triangles <= 3.0, "{triangles} tests in a scene of 3 triangles");
    }
    assert_ne!(folder.bytes("boxes.png"), folder.bytes("triangles.png"));
}

#[test]
fn a_wide_node_counts_as_eight_boxes() {
    let folder = Folder::with_small();
    let facts = folder.run(&format!("{QUICK} --heatmap boxes --json")).done().json();
    assert_eq!(facts["box_tests_per_ray"], 0.0, "three triangles are one leaf");
    // One ray through a stack of 64 squares; a leaf holds at most 32 triangles.
    let corners = (0..64).map(|z| format!("v 0 0 {z}\nv 2 0 {z}\nv 2 2 {z}\nv 0 2 {z}\n"));
    let faces = (0..64).map(|i| 4 * i + 1).map(|i| format!("f {i} {} {} {}\n", i + 1, i + 2, i + 3));
    folder.write("stack.obj", corners.chain(faces).collect::<String>());
    let camera = "--eye 1.2,1,99 --target 1.2,1,0 --up 0,1,0 --size 1x1";
    for preset in ["dynamic", "fast", "balanced", "quality"] {
        let line = format!("render stack.obj {camera} --heatmap boxes --preset {preset} --json");
        let facts = folder.run(&line).done().json();
        let [boxes, triangles] =
            ["box_tests_per_ray", "triangle_tests_per_ray"].map(|key| facts[key].as_f64().unwrap());
        assert!(boxes >= 8.0 && boxes % 8.0 == 0.0, "{preset}: {boxes} boxes");
        assert!((1.0..128.0).contains(&triangles), "{preset}: {triangles} triangles of 128");
    }
    let binary = folder.run(&format!("render stack.obj {camera} --heatmap boxes --volumes aabb --json")).done().json();
    assert!(binary["box_tests_per_ray"].as_f64().unwrap() >= 2.0, "{binary}");
}

#[test]
fn pictures_show_the_requested_light() {
    let folder = Folder::with_small();
    // Every pixel shows the environment.
    let away = "--eye 0,0,9 --target 0,0,99 --up 0,1,0";
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --env 0.25,0.5,1 -o sky.exr")).done();
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --env 0.5,1,2 -o bright.exr")).done();
    let found = folder.run("compare bright.exr sky.exr --json").done().json();
    assert_eq!(found["mean_ratio"].as_f64().unwrap(), 2.0);
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --env 0,0,0 -o black.exr")).done();
    folder.run(&format!("render small.obj --size 8x8 --spp 1 {away} --sun 0,0,-1,1,1,1 -o sun.exr")).done();
    folder.run("compare black.exr sun.exr --max 0").done();
    // A sun straight above gray ground reflects albedo times irradiance over pi, proportional to the irradiance.
    let down = "--eye 0.9,0.9,9 --target 0.9,0.9,0 --up 0,1,0 --fov 0.5 --bounces 0";
    for irradiance in [1, 2] {
        let sun = format!("--sun 0,0,-1,{irradiance},{irradiance},{irradiance}");
        folder.run(&format!("render small.obj --size 8x8 --spp 1 {down} {sun} -o sun{irradiance}.exr")).done();
    }
    let found = folder.run("compare sun2.exr sun1.exr --json").done().json();
    assert_eq!(found["mean_ratio"].as_f64().unwrap(), 2.0);
    assert!(found["rmse"].as_f64().unwrap() > 0.0, "the ground is lit");
}

/// From options and from scene files, the picture has the same bits as that of a pinhole camera.
#[test]
fn an_aperture_of_zero_is_a_pinhole() {
    const CAMERA: &str = "--eye 0.5,2,4 --target 0.5,0.5,0 --size 48x27 --spp 2";
    let folder = Folder::with_small();
    let picture = |scene: &str| {
        folder.run(&format!("render {scene} -o out.exr")).done();
        folder.bytes("out.exr")
    };
    for integrator in ["hybrid", "path"] {
        let plain = format!("small.obj {CAMERA} --integrator {integrator}");
        folder.run(&format!("scene {plain} --aperture 0.25 -o lens.toml")).done();
        let file = folder.text("lens.toml");
        assert!(file.contains("aperture_radius = 0.25"), "{file}");
        folder.write("none.toml", file.replace("aperture_radius = 0.25", "aperture_radius = 0.0"));
        let pinhole = picture(&plain);
        for scene in [&format!("{plain} --aperture 0"), "lens.toml --aperture 0", "none.toml"] {
            assert!(picture(scene) == pinhole, "{scene}, {integrator}");
        }
        assert!(picture("lens.toml") != pinhole, "{integrator}: no blur");
    }
}

/// The sum of emitted and reflected light overflows.
#[test]
fn samples_that_overflow_are_counted_and_the_first_is_reported() {
    let folder = Folder::with_small();
    folder.write("bright.mtl", "newmtl bright\nKd 0.8 0.8 0.8\nKe 3e38 0 0\n");
    folder.write("bright.obj", "mtllib bright.mtl\nusemtl bright\nv 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3 4\n");
    // A square in the upper right quarter of the picture, in front of a constant sky. The other quarters are finite.
    let camera = "--eye 0,0,1 --target 0,0,0 --up 0,1,0 --fov 90 --size 8x4 --spp 3 --device cpu --bounces 0";
    let run = folder.run(&format!("render bright.obj {camera} --env 3e38,0,0 --json -o out.exr")).done();
    assert_eq!(run.json()["dropped_samples"], 4 * 2 * 3);
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
    let warning = "warning: dropped 24 samples that were not finite, the first in pixel (4, 0)";
    assert!(run.stderr.contains(warning), "{}", run.stderr);
    let finite = folder.run(&format!("render bright.obj {camera} --env 3e37,0,0 --json -o out.exr")).done();
    assert_eq!((&finite.json()["dropped_samples"], finite.n_warnings()), (&0.into(), 0), "{}", finite.stderr);
    let of_parts = camera.replace("--spp 3", "");
    for samples in ["0..1", "1..3"] {
        folder.run(&format!("render bright.obj {of_parts} --env 3e38,0,0 --samples {samples} -o {samples}.exr")).done();
    }
    let merged = folder.run("merge 0..1.exr 1..3.exr -o whole.exr").done();
    assert!(merged.stdout.contains("dropped 24 samples that were not finite"), "{}", merged.stdout);
}

// What is chosen for a scene: light, integrator, camera; crops, exposure and formats.

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
    // Strong emission that lights nothing else is no lamp, either.
    let strong = folder.run(&format!("strong.obj {LINE} --json")).done();
    assert!(strong.json()["default_light"].is_number(), "{}", strong.stderr);
    let square = |y: f32, size: f32, first: u32, order: &str| {
        let corners = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        let lines = corners.map(|[x, z]: [f32; 2]| format!("v {} {y} {}\n", x * size, z * size)).concat();
        let indices = order.split(' ').map(|i| (first + i.parse::<u32>().unwrap()).to_string()).collect::<Vec<_>>();
        format!("{lines}f {}\n", indices.join(" "))
    };
    let wall = "newmtl w\nKd 0.7 0.7 0.7\n";
    folder.write("room.mtl", format!("newmtl a\nKd 0 0 0\nKe 5 5 5\n{wall}"));
    let lamp = square(2.0, 0.5, 0, "4 3 2 1");
    let lit = format!("mtllib room.mtl\nusemtl a\n{lamp}usemtl w\n{}", square(0.0, 2.0, 4, "1 2 3 4"));
    folder.write("lit.obj", lit);
    let lit = folder.run(&format!("lit.obj {LINE} --json --eye 3,4,5 --target 0,0,0")).done();
    assert!(lit.json()["default_light"].is_null() && lit.json()["light"] == "surfaces that emit", "{}", lit.stdout);
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
    // A lamp that lights nothing else is a surface in the default light.
    for (material, integrator) in [("mirror", "path"), ("lamp", "hybrid"), ("plain", "hybrid")] {
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
    // It faces the light.
    let square = "v -0.65 -0.97 0.83\nv 1.16 -0.12 0.83\nv 0.65 0.97 -0.83\nv -1.16 0.12 -0.83\nf 1 2 3 4\n";
    folder.write("white.obj", format!("mtllib white.mtl\nusemtl a\n{square}"));
    folder.run("white.obj --size 64x48 --spp 512 --device cpu").done();
    let image = image::load_from_memory(&folder.bytes("white.png")).unwrap().to_rgb8();
    // But for noise.
    let n_white = image.pixels().filter(|pixel| pixel.0 == [255; 3]).count();
    assert!(n_white < 64 * 48 / 50, "{n_white} pixels are white");
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

#[test]
fn a_camera_looks_straight_down_and_an_impossible_one_is_one_sentence() {
    let folder = Folder::with_small();
    let picture = |camera: &str| {
        folder.run(&format!("render small.obj {LINE} -o a.png {camera}")).done();
        folder.bytes("a.png")
    };
    // The front of the scene is at the bottom of the picture, from below at its top, as in a view that is a little off.
    for (camera, near) in [("--eye 0,5,0", "--eye 0,5,0.001"), ("--eye 0,-5,0", "--eye 0,-5,0.001")] {
        let [a, b] = [camera, near].map(|eye| {
            let bytes = picture(&format!("{eye} --target 0,0,0"));
            image::load_from_memory(&bytes).unwrap().to_rgb8()
        });
        let n_far = a.pixels().zip(b.pixels()).filter(|(a, b)| a.0[0].abs_diff(b.0[0]) > 40).count();
        assert!(n_far < a.pixels().len() / 50, "{camera}: {n_far} pixels differ");
    }
    for (camera, words) in [("--target 1,2,3 --eye 1,2,3", "coincide"), ("--eye 0,5,0 --target 0,0,0 --up 0,1,0", "up")]
    {
        let run = folder.run(&format!("render small.obj {LINE} -o b.png {camera}")).refused(&["camera", words]);
        assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
    }
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
    let line = "--size 64x48 --spp 256 --device cpu";
    folder.run(&format!("small.obj {line}")).done();
    folder.run(&format!("turned.obj {line} --up-axis z")).done();
    folder.run(&format!("turned.obj {line} --up 0,0,1 -o up.png")).done();
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

// `--env` with environment maps, and `--time`.

/// A map of 2 x 1 texels in flat RGBE: the left half of all directions is red, the right half green.
const TWO: [u8; 8] = [128, 0, 0, 129, 0, 128, 0, 129];

/// A folder with `two.hdr`, and a model behind the camera of [`render`].
fn folder() -> Folder {
    let folder = Folder::with_small();
    folder.write("two.hdr", [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".as_slice(), &TWO].concat());
    folder
}

/// Renders the directions around -z, the center of the map.
fn render(folder: &Folder, options: &str) -> Run {
    let camera = "--eye 0,0,-9 --target 0,0,-10 --size 8x4 --spp 4";
    folder.run(&format!("render small.obj -o out.png {camera} {options}"))
}

/// Red and green of the left and right half of the picture.
fn halves(folder: &Folder, options: &str) -> [[u8; 2]; 2] {
    render(folder, options).done();
    let image = image::load_from_memory(&folder.bytes("out.png")).unwrap().to_rgb8();
    [0, 7].map(|x| [image.get_pixel(x, 1).0[0], image.get_pixel(x, 1).0[1]])
}

#[test]
fn a_map_is_visible_behind_the_scene() {
    let folder = folder();
    let [left, right] = halves(&folder, "--env two.hdr");
    assert!(left[0] > left[1] && right[1] > right[0], "{left:?} {right:?}");
    let [left, right] = halves(&folder, "--env two.hdr --env-turn 180");
    assert!(left[1] > left[0] && right[0] > right[1], "turned: {left:?} {right:?}");
    let [dark, _] = halves(&folder, "--env two.hdr --env-scale 0.25");
    assert!(dark[0] > 0 && dark[0] < 200, "scaled: {dark:?}");
}

#[test]
fn env_scale_applies_to_constant_light() {
    let folder = folder();
    assert_eq!(halves(&folder, "--env 0.5,1,0 --env-scale 2"), halves(&folder, "--env 1,2,0"));
}

#[test]
fn invalid_environments_are_rejected() {
    let folder = folder();
    folder.write("text.exr", "text");
    folder.write("cut.hdr", &folder.bytes("two.hdr")[..40]);
    render(&folder, "--env absent.hdr").refused(&["absent.hdr", "cannot read file"]);
    render(&folder, "--env text.exr").refused(&["text.exr", "expected Radiance HDR or OpenEXR"]);
    render(&folder, "--env cut.hdr").refused(&["cut.hdr"]);
    render(&folder, "--env two.jpg").refused(&["--env", "use R,G,B or a .hdr or .exr file"]);
    render(&folder, "--env 1,1,1 --env-scale -1").refused(&["--env-scale"]);
    render(&folder, "--env 3e38,1,1 --env-scale 10").refused(&["--env", "--env-scale 10"]);
    render(&folder, "--env-turn 90").refused(&["--env"]);
    assert!(!folder.names().iter().any(|name| name == "out.png"));
}

#[test]
fn exr_and_hdr_maps_of_one_sky_give_the_same_picture() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let models = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    let [exr, hdr] = ["exr", "hdr"].map(|ending| models.join(format!("env/sky_64x32.{ending}")));
    if !exr.is_file() {
        skip::<()>("exr_and_hdr_maps_of_one_sky_give_the_same_picture", format_args!("there is no {}", exr.display()));
        return;
    }
    let folder = Folder::with_small();
    let pictures = [exr, hdr].map(|sky| {
        folder.run(&format!("render small.obj -o out.png --size 32x16 --env {}", sky.display())).done();
        image::load_from_memory(&folder.bytes("out.png")).unwrap().to_rgb8().into_raw()
    });
    // RGBE has eight bits for the largest channel, a few of the 256 steps of the picture.
    let most = pictures[0].iter().zip(&pictures[1]).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(most.is_some_and(|most| most <= 4), "{most:?}");
}

#[test]
fn a_time_without_an_animation_is_reported() {
    let folder = Folder::with_small();
    let run = folder.run("render small.obj -o out.png --size 8x8 --time 1.5").done();
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
    folder.run("render -o out.png --time 1").refused(&["SCENE"]);
    folder.run("render small.obj -o out.png --time nan").refused(&["--time"]);
}

/// A triangle in z = 0 that moves by ten units along x in two seconds.
const ANIMATED: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"uri":"numbers.bin","byteLength":68}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},
{"buffer":0,"byteOffset":44,"byteLength":24}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
{"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR"},
{"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}],
"animations":[{"samplers":[{"input":1,"output":2}],
"channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}]}"#;

/// A folder with `animated.gltf`.
pub(crate) fn animated() -> Folder {
    let folder = Folder::new();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let numbers = corners.into_iter().chain([0.0, 2.0]).chain([0.0, 0.0, 0.0, 10.0, 0.0, 0.0]);
    folder.write("numbers.bin", numbers.flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    folder.write("animated.gltf", ANIMATED);
    folder
}

#[test]
fn rays_hit_the_posed_scene() {
    let folder = animated();
    folder.write("rays.csv", "ox,oy,oz,dx,dy,dz,tmax\n0.25,0.25,1,0,0,-1,inf\n5.25,0.25,1,0,0,-1,inf\n");
    let is_hit = |options: &str| -> Vec<bool> {
        folder.run(&format!("cast animated.gltf --rays rays.csv --hits hits.csv {options}")).done();
        let hits = rows::<f64>(&folder.text("hits.csv"), "t,prim,u,v,instance");
        hits.iter().map(|hit| hit[1] >= 0.0).collect()
    };
    assert_eq!(is_hit(""), [true, false]);
    assert_eq!(is_hit("--time 1"), [false, true]);
    folder.run("stats animated.gltf --time 1 --threads 1").done();
    folder.run("stats --time 1").refused(&["SCENE"]);
}
