//! `--frames`: names and times of frames, motion and turntables; `--resume`.

use serde_json::{Value, json};

use crate::{gpu::adapter, support::Folder};

const QUICK: &str = "--size 40x30 --spp 2";

/// A scene with a node that slides, a sail that a morph target moves, and a fixed triangle; `bad` is the last of the key
/// values of a second animation of the sail, 0, 1, 2, ... half a second apart.
fn moving(bad: f32) -> (Value, Vec<u8>) {
    let lists: [&[f32]; 7] = [
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        &[0.0, 2.0],
        &[0.0, 0.0, 0.0, 3.0, 0.5, 1.0],
        &[0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.5, 0.0, 0.0],
        &[0.0, 1.0],
        &[0.0, 0.5, 1.0, 1.5],
        &[0.0, 1.0, 2.0, bad],
    ];
    let (mut views, mut accessors, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
    for (view, list) in lists.into_iter().enumerate() {
        let (element, width) = if [0, 2, 3].contains(&view) { ("VEC3", 3) } else { ("SCALAR", 1) };
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * list.len() }));
        accessors
            .push(json!({ "bufferView": view, "componentType": 5126, "type": element, "count": list.len() / width }));
        bytes.extend(list.iter().flat_map(|x| x.to_le_bytes()));
    }
    let channel = |sampler: usize, node: usize, path: &str| json!({ "sampler": sampler, "target": { "node": node, "path": path } });
    let file = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": bytes.len(), "uri": "moving.bin" }],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [
            { "name": "fixed", "primitives": [{ "attributes": { "POSITION": 0 } }] },
            { "name": "sail", "primitives": [{ "attributes": { "POSITION": 0 }, "targets": [{ "POSITION": 3 }] }] },
        ],
        "nodes": [
            { "mesh": 0 },
            { "mesh": 0, "translation": [0, 1.5, 0], "rotation": [0.1, 0.3, 0.2, 0.9] },
            { "mesh": 1, "translation": [0, -1.5, 0.25], "weights": [0.125] },
        ],
        "animations": [
            {
                "name": "slide",
                "channels": [channel(0, 0, "translation"), channel(1, 2, "weights")],
                "samplers": [{ "input": 1, "output": 2 }, { "input": 1, "output": 4 }],
            },
            {
                "name": "tear",
                "channels": [channel(0, 2, "weights")],
                "samplers": [{ "input": 5, "output": 6, "interpolation": "STEP" }],
            },
        ],
    });
    (file, bytes)
}

fn folder(bad: f32) -> Folder {
    let (folder, (file, bytes)) = (Folder::with_small(), moving(bad));
    folder.write("moving.gltf", file.to_string());
    folder.write("moving.bin", bytes);
    folder
}

/// Renders the frames `numbers` at `fps` and compares each with the picture of its time.
#[track_caller]
fn frames_match(folder: &Folder, options: &str, [first, end]: [u32; 2], fps: f64, extension: &str) -> Value {
    let line = format!("render {options} --frames {first}..{end} --fps {fps} --json -o frame_%03d.{extension}");
    let report = folder.run(&line).done();
    for frame in first..end {
        let name = format!("frame_{frame:03}.{extension}");
        let mut single = options.replace("--update refit", "").replace("--update rebuild", "");
        if single.contains("--shutter") {
            single += &format!(" --fps {fps}");
        }
        folder.run(&format!("render {single} --time {} -o single.{extension}", f64::from(frame) / fps)).done();
        assert!(folder.bytes(&name) == folder.bytes(&format!("single.{extension}")), "{line}: frame {frame}");
        std::fs::remove_file(folder.path(&name)).unwrap();
    }
    report.json()
}

/// On a GPU, too, where each frame uploads what changed; binary BVHs are updated there.
#[test]
fn frames_of_a_gpu_are_the_pictures_of_their_times() {
    let Some(_) = adapter("frames_of_a_gpu_are_the_pictures_of_their_times") else { return };
    let folder = folder(3.0);
    for options in ["--levels two", "--levels two --volumes combined --update refit", "--levels one --volumes aabb"] {
        let options = format!("moving.gltf {QUICK} {options} --device gpu");
        let report = frames_match(&folder, &options, [2, 5], 7.0, "exr");
        let whole = folder.run(&format!("render {options} --time 0 --json -o single.exr")).done().json();
        let [all, one] = [&report, &whole].map(|report| report["gpu_uploaded_bytes"].as_u64().unwrap());
        // Builds on the device upload the sizes of their dispatches, which are more than these triangles.
        let is_less = all < 3 * one || options.contains("--volumes");
        assert!(all > one && is_less, "{options}: {all} bytes for three frames, {one} for one");
    }
}

#[test]
fn frames_are_the_pictures_of_their_times() {
    let folder = folder(3.0);
    for options in ["", "--levels two", "--update rebuild", "--levels two --update refit", "--volumes dop --levels two"]
    {
        frames_match(&folder, &format!("moving.gltf {QUICK} {options}"), [3, 7], 7.0, "png");
    }
    let light = "--sun 0.2,-0.3,-1,3,3,3 --eye 1,1,8 --target 1,0,0";
    for options in [
        "--animation tear --integrator path --env 0.5,0.6,0.7",
        "--animation 1 --samples 1..3",
        "--aovs all",
        "--heatmap boxes --levels two",
        "--shutter 0..0.5",
        "--shutter -0.25..1e-3 --integrator path --aovs all",
    ] {
        let quick = if options.contains("--samples") { "--size 40x30" } else { QUICK };
        let light = if options.contains("--env") || options.contains("--heatmap") { "" } else { light };
        let extension = if options.contains("--heatmap") { "png" } else { "exr" };
        frames_match(&folder, &format!("moving.gltf {quick} {light} {options}"), [0, 3], 1.5, extension);
    }
}

#[test]
fn frames_of_real_models_are_the_pictures_of_their_times() {
    let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let scenes = std::env::var("CANTED_SCENES").unwrap_or_else(|_| scenes.to_owned());
    for (file, options) in [
        ("gltf/Fox.glb", "--animation Run"),
        ("gltf/Fox.glb", "--animation 1 --levels two --update refit"),
        ("gltf/CesiumMan.glb", ""),
        ("gltf/SimpleMorph.gltf", "--levels two"),
        ("gltf/Fox.glb", "--animation Run --shutter 0..0.5"),
        ("gltf/SimpleMorph.gltf", "--shutter -0.5..0.5 --update refit"),
    ] {
        let path = format!("{scenes}/{file}");
        if !std::path::Path::new(&path).is_file() {
            canted_fixtures::skip::<()>(
                "frames_of_real_models_are_the_pictures_of_their_times",
                format_args!("missing file {path}"),
            );
            continue;
        }
        frames_match(&Folder::new(), &format!("{path} --size 40x30 --spp 1 {options}"), [0, 4], 9.0, "png");
    }
}

#[test]
fn samples_of_frames_merge_to_the_bytes_of_one_render() {
    let folder = folder(3.0);
    for (range, name) in [("0..5", "whole"), ("0..2", "first"), ("2..5", "last")] {
        let options = format!("--size 40x30 --frames 1..4 --fps 7 --samples {range}");
        folder.run(&format!("render moving.gltf {options} -o {name}_%03d.exr")).done();
    }
    for frame in 1..4 {
        folder.run(&format!("merge last_{frame:03}.exr first_{frame:03}.exr -o merged.exr")).done();
        assert!(folder.bytes("merged.exr") == folder.bytes(&format!("whole_{frame:03}.exr")), "frame {frame}");
    }
    // Parts of different frames are parts of different pictures.
    folder.run("merge first_001.exr last_002.exr -o out.exr").refused(&["first_001.exr", "last_002.exr", "scene is"]);
}

/// The counters state what each update did.
#[test]
fn only_what_changes_is_updated() {
    let folder = folder(3.0);
    let counts = |options: &str| {
        let facts = frames_match(&folder, &format!("moving.gltf {QUICK} --ground off {options}"), [0, 5], 4.0, "png");
        ["bvhs_unchanged", "bvh_refits", "bvh_rebuilds", "top_unchanged", "top_refits", "top_rebuilds", "whole_updates"]
            .map(|key| facts[key].as_u64().unwrap_or_else(|| panic!("{options}: {facts}")))
    };
    // Two meshes, of which the sail changes in each of four updates.
    assert_eq!(counts("--levels two --update refit"), [4, 4, 0, 0, 4, 0, 0]);
    assert_eq!(counts("--levels two --update rebuild"), [4, 0, 4, 0, 0, 4, 0]);
    assert_eq!(counts("--levels one --update refit"), [0, 4, 0, 0, 0, 0, 0]);
    // The steps of the second animation change two of four frames.
    assert_eq!(counts("--levels two --update refit --animation tear"), [6, 2, 0, 2, 2, 0, 0]);
    assert_eq!(counts("--levels one --update refit --animation tear"), [2, 2, 0, 0, 0, 0, 0]);
    // Binary BVHs cannot be refitted.
    assert_eq!(counts("--levels two --update refit --volumes aabb"), [4, 0, 4, 0, 4, 0, 0]);
    // A heat map shows the BVH, which must be that of a single picture.
    assert_eq!(counts("--levels two --heatmap boxes"), [0; 7]);
}

#[test]
fn a_turntable_turns_the_camera_and_nothing_else() {
    let folder = Folder::with_small();
    let camera = |eye: &str| {
        format!("{QUICK} --eye {eye} --target 0.5,0.5,0.5 --up 0,1,0 --sun 1,-1,-1,3,3,3 --env 0.1,0.2,0.3")
    };
    let line = format!("render small.obj {} --frames 0..4 --turntable 360 --json -o t%d.png", camera("0.5,2.5,4.5"));
    let run = folder.run(&line).done();
    assert_eq!(run.n_warnings(), 0, "{}", run.stderr);
    assert_eq!(run.json()["bvhs_unchanged"], 3);
    for (frame, eye) in ["0.5,2.5,4.5", "4.5,2.5,0.5", "0.5,2.5,-3.5", "-3.5,2.5,0.5"].iter().enumerate() {
        folder.run(&format!("render small.obj {} -o single.png", camera(eye))).done();
        assert!(folder.bytes(&format!("t{frame}.png")) == folder.bytes("single.png"), "frame {frame}");
    }
    folder.run(&format!("render --frames 0..2 --turntable -90 {QUICK} -o b%d.png")).done();
    folder.run(&format!("render {QUICK} -o single.png")).done();
    assert!(folder.bytes("b0.png") == folder.bytes("single.png"), "the built-in scene");
    assert!(folder.bytes("b1.png") != folder.bytes("b0.png"));
}

#[test]
fn a_static_file_shows_one_pose_with_one_warning() {
    let folder = Folder::with_small();
    let run = folder.run(&format!("render small.obj --frames 0..3 {QUICK} -o f%d.png")).done();
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
    assert!(run.stderr.contains("small.obj: the file has no animation"), "{}", run.stderr);
    assert!(folder.bytes("f0.png") == folder.bytes("f2.png"));
}

#[test]
fn a_pose_that_is_not_finite_names_frame_mesh_and_vertex() {
    for bad in [f32::NAN, f32::INFINITY] {
        let folder = folder(bad);
        // Frame 30 of 60 is at 1.5 seconds, where the weight is bad: the product with an offset of zero is NaN too.
        let line = "render moving.gltf --size 8x6 --spp 1 --animation tear --fps 20 --frames 0..60 -o frame_%02d.png";
        let named = ["frame 30: moving.gltf: mesh 1 \"sail\": primitive 0 vertex 0 is not finite: NaN, NaN, NaN"];
        folder.run(line).refused(&named);
        let whole = |end: u32, list: &[&str]| {
            let mut names: Vec<String> = (0..end).map(|n| format!("frame_{n:02}.png")).collect();
            names.extend(["moving.bin", "moving.gltf", "small.obj"].iter().chain(list).map(|&name| name.to_owned()));
            names.sort();
            names
        };
        assert_eq!(folder.names(), whole(30, &["frame_%02d.png.frames"]));
        let pictures = || -> Vec<Vec<u8>> { (0..30).map(|n| folder.bytes(&format!("frame_{n:02}.png"))).collect() };
        let before = pictures();
        // The file is mended, and the run resumes.
        let (file, bytes) = moving(3.0);
        folder.write("moving.gltf", file.to_string());
        folder.write("moving.bin", bytes);
        let facts = folder.run(&format!("{line} --resume --json")).done().json();
        assert_eq!((&facts["rendered_frames"], &facts["kept_frames"]), (&30.into(), &30.into()));
        assert_eq!(folder.names(), whole(60, &[]), "a finished sequence has no list");
        assert!(pictures() == before);
    }
}

/// An open shutter changes the picture where something moves, and only there.
#[test]
fn the_shutter_blurs_what_moves() {
    let folder = folder(3.0);
    let line = format!("render moving.gltf {QUICK} --time 0.5 -o");
    folder.run(&format!("{line} still.png")).done();
    folder.run(&format!("{line} blurred.png --shutter 0..0.5")).done();
    assert!(folder.bytes("still.png") != folder.bytes("blurred.png"));
    // The second animation stands still until half a second.
    folder.run(&format!("{} tear.png --animation tear", line.replace("0.5", "0.125"))).done();
    folder.run(&format!("{} open.png --animation tear --shutter 0..0.5", line.replace("0.5", "0.125"))).done();
    assert!(folder.bytes("tear.png") == folder.bytes("open.png"));
    // A file without animation.
    let run = folder.run(&format!("render small.obj {QUICK} --time 0.5 --shutter 0..0.5 -o small.png")).done();
    assert!(run.n_warnings() == 1 && run.stderr.contains("has no animation"), "{}", run.stderr);
}

#[test]
fn invalid_frame_options_are_one_error() {
    let folder = folder(3.0);
    let refused = |options: &str, words: &[&str]| {
        let names = folder.names();
        folder.run(&format!("render {options}")).refused(words);
        assert_eq!(folder.names(), names, "{options}");
    };
    let line = "moving.gltf --size 8x8 --spp 1";
    refused(&format!("{line} --frames 0..2 -o f.png"), &["f.png", "field", "frame_%04d.png"]);
    refused(&format!("{line} --frames 0..2"), &["canted.png", "field"]);
    refused(&format!("{line} --frames 0..2 -o %d_%d.png"), &["%d_%d.png", "more than one field"]);
    refused(&format!("{line} --frames 0..2 -o %s.png"), &["%s.png", "unsupported field"]);
    refused(&format!("{line} --frames 0..2 -o f%d.gif"), &["f%d.gif", ".gif"]);
    refused(&format!("{line} --frames 0..2 -o no/f%d.png"), &["no/f0.png"]);
    refused(&format!("{line} --frames 2..2 -o f%d.png"), &["2..2 is empty"]);
    refused(&format!("{line} --frames 2 -o f%d.png"), &["A..B"]);
    refused(&format!("{line} --frames 0..-2 -o f%d.png"), &["A..B"]);
    refused(&format!("{line} --frames 0..2 --fps 0 -o f%d.png"), &["greater than 0"]);
    refused(&format!("{line} --frames 0..2 --fps nan -o f%d.png"), &["greater than 0"]);
    refused(&format!("{line} --frames 0..2 --fps 1e-300 -o f%d.png"), &["frame 1", "single precision"]);
    refused(&format!("{line} --frames 0..2 --time 1 -o f%d.png"), &["--time"]);
    refused(&format!("{line} --fps 3 -o f.png"), &["--frames"]);
    refused(&format!("{line} --turntable 90 -o f.png"), &["--frames"]);
    refused(&format!("{line} --resume -o f.png"), &["--frames"]);
    refused(&format!("{line} --update refit -o f.png"), &["--frames"]);
    refused(&format!("{line} --frames 0..2 --update never -o f%d.png"), &["never"]);
    refused(&format!("{line} --animation slide -o f.png"), &["--animation requires --time or --frames"]);
    for options in ["--time 0 -o f.png", "--frames 0..2 -o f%d.png"] {
        refused(&format!("{line} --animation fly {options}"), &["moving.gltf", "'fly'", "0 \"slide\", 1 \"tear\""]);
        refused(&format!("{line} --animation 2 {options}"), &["'2'", "0 \"slide\", 1 \"tear\""]);
    }
    refused(&format!("{line} --shutter 0..0.5 -o f.png"), &["--shutter requires --time or --frames"]);
    refused(&format!("{line} --time 1 --shutter 0.5..0.5 -o f.png"), &["0.5..0.5 is empty"]);
    refused(&format!("{line} --time 1 --shutter 0.5 -o f.png"), &["A..B"]);
    refused(&format!("{line} --time 1 --shutter 0..nan -o f.png"), &["A..B"]);
    refused(&format!("{line} --time 1 --shutter 0..1e300 -o f.png"), &["--shutter", "single precision"]);
    refused(&format!("{line} --time 0.5 --shutter 0..0.5 --accel bih -o f.png"), &["deforms", "--accel wide"]);
    refused("--time 1 --shutter 0..0.5 -o f.png", &["SCENE"]);
    refused("small.obj --animation 0 --frames 0..2 -o f%d.png", &["small.obj", "no animation"]);
    refused("--frames 0..2 -o f%d.png", &["--turntable"]);
    folder.write("scene.toml", "[[assets]]\nname = \"a\"\nfile = \"moving.gltf\"\n");
    refused("scene.toml --frames 0..2 -o f%d.png", &["scene.toml", "--turntable"]);
    refused("scene.toml --time 1 --animation tear -o f.png", &["scene.toml", "[[assets]]"]);
    refused("scene.toml --time 1 --shutter 0..1 -o f.png", &["scene.toml", "--shutter requires a glTF file"]);
}

/// A frame never replaces a file that the scene is read from.
#[test]
fn frames_do_not_replace_inputs() {
    let folder = folder(3.0);
    let (mut file, _) = moving(3.0);
    file["images"] = json!([{ "uri": "wood_1.png" }]);
    file["textures"] = json!([{ "source": 0 }]);
    file["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
    file["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(0);
    file["meshes"][0]["primitives"][0]["material"] = json!(0);
    file["accessors"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "bufferView": 0, "componentType": 5126, "type": "VEC2", "count": 3 }));
    file["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(7);
    folder.write("moving.gltf", file.to_string());
    folder.run("render small.obj --size 4x4 --spp 1 -o wood_1.png").done();
    let before = folder.bytes("wood_1.png");
    folder
        .run("render moving.gltf --frames 0..3 --size 8x8 --spp 1 -o wood_%d.png")
        .refused(&["wood_1.png", "same file"]);
    assert!(folder.bytes("wood_1.png") == before);
    assert!(!folder.path("wood_0.png").exists());
}

/// A scene file of an animation gives the picture of the options.
#[test]
fn scene_files_name_the_animation() {
    let folder = folder(3.0);
    let options = format!("moving.gltf {QUICK} --time 0.75 --animation tear");
    folder.run(&format!("scene {options} -o scene.toml")).done();
    assert!(folder.text("scene.toml").contains("animation = \"tear\""));
    folder.run(&format!("render {options} -o a.png")).done();
    folder.run("render scene.toml -o b.png").done();
    assert!(folder.bytes("a.png") == folder.bytes("b.png"));
}

#[test]
fn stats_predict_when_a_rebuild_pays() {
    let folder = folder(3.0);
    let motion = |line: &str| folder.run(&format!("stats {line} --json --device cpu")).done().json()["motion"].clone();
    let slide = motion("moving.gltf");
    // One level over all triangles.
    assert_eq!((&slide["frames"], &slide["bvhs"], &slide["changing_bvhs"]), (&8.into(), &1.into(), &1.into()));
    assert!(slide["build_ms"].as_f64().unwrap() > 0.0 && slide["update_ms"].as_f64().unwrap() > 0.0, "{slide}");
    assert!(slide["drift"].as_f64().unwrap() >= 1.0, "{slide}");
    // The second animation stands still for the first half second.
    assert_eq!(motion("moving.gltf --time 0 --animation tear")["changing_bvhs"], 0);
    assert_eq!(motion("small.obj"), Value::Null);
    let text = folder.run("stats moving.gltf --device cpu").done().stdout;
    assert!(
        text.contains("Motion, 8 frames at 24 per second: 1 of 1 BVHs") && text.contains("--update auto "),
        "{text}"
    );
}

// `--resume`: which frames are kept, rendered again, or refused.

#[test]
fn whole_frames_are_kept_and_others_rendered_again() {
    let folder = folder(3.0);
    let line = format!("render moving.gltf {QUICK} --frames 0..4 --fps 3 -o f%d.png");
    folder.run(&line).done();
    let all = || [0, 1, 2, 3].map(|n| folder.bytes(&format!("f{n}.png")));
    let expected = all();
    let half = &expected[2][..expected[2].len() / 2];
    folder.write("f2.png", half);
    std::fs::remove_file(folder.path("f3.png")).unwrap();
    let kept = std::fs::metadata(folder.path("f1.png")).unwrap().modified().unwrap();
    let run = folder.run(&format!("{line} --resume --json")).done();
    assert_eq!((&run.json()["rendered_frames"], &run.json()["kept_frames"]), (&2.into(), &2.into()));
    assert!(run.n_warnings() >= 1 && run.stderr.contains("f2.png"), "{}", run.stderr);
    assert_eq!(all(), expected);
    assert_eq!(std::fs::metadata(folder.path("f1.png")).unwrap().modified().unwrap(), kept);
    // Nothing is left to do.
    assert_eq!(folder.run(&format!("{line} --resume --json")).done().json()["rendered_frames"], 0);
    // Without --resume, frames are replaced.
    folder.write("f0.png", "old");
    folder.run(&line).done();
    assert_eq!(all(), expected);
    // A picture of another size is of another sequence; no frame is touched.
    folder.run(&line.replace("40x30", "30x40").replace("-o", "--resume -o")).refused(&["f0.png", "40 x 30", "30 x 40"]);
    assert_eq!(all(), expected);
}

/// Options that make other pictures of [`SEQUENCE`], what `--resume` reports of an unfinished sequence, and the frame that differs first.
const OTHERS: [(&str, [&str; 2]); 12] = [
    ("--seed 7", ["f0.png", "another seed: 0, not 7"]),
    ("--integrator hybrid", ["f0.png", "another choice of integrator: by the scene, not Hybrid"]),
    ("--spp 3", ["f0.png", "another range of samples: 0..2, not 0..3"]),
    ("--fps 4", ["f1.png", "another pose"]),
    ("--animation tear", ["f1.png", "another pose"]),
    ("--shutter 0..0.5", ["f0.png", "another pose"]),
    ("--turntable 90", ["f1.png", "another turn in degrees: 0, not 22.5"]),
    ("--eye 1,1,8 --target 1,0,0", ["f0.png", "another camera"]),
    ("--sun 0.2,-0.3,-1,3,3,3", ["f0.png", "another light"]),
    ("--env 0.5,0.6,0.7", ["f0.png", "another light"]),
    ("--levels two", ["f0.png", "another acceleration structure"]),
    ("--heatmap boxes", ["f0.png", "another heat map"]),
];

const SEQUENCE: &str = "--fps 3 -o f%d.png --frames";

/// The line of a sequence with other options.
fn with(line: &str, other: &str) -> String {
    let replaced = ["--spp 2", "--fps 3"].into_iter().find(|replaced| other.starts_with(&replaced[..5]));
    let line = replaced.map_or_else(|| line.to_owned(), |replaced| line.replace(replaced, ""));
    format!("{line} --resume {other}")
}

/// A frame of an unfinished sequence is kept only by the options, the pose and the file that it was rendered with.
#[test]
fn frames_of_other_options_or_scenes_are_not_kept() {
    let folder = folder(3.0);
    // A folder has the name of the last frame.
    std::fs::create_dir(folder.path("f3.png")).unwrap();
    let line = format!("render moving.gltf {QUICK} {SEQUENCE} 0..4");
    folder.run(&line).refused(&["f3.png", "it is a folder"]);
    std::fs::remove_dir(folder.path("f3.png")).unwrap();
    let all = || [0, 1, 2].map(|n| folder.bytes(&format!("f{n}.png")));
    let expected = all();
    for (other, words) in OTHERS {
        folder.run(&with(&line, other)).refused(&words);
        assert_eq!(all(), expected, "{other}");
    }
    // Another picture of the same size, a scene that changed, and a list without such a line.
    folder.write("f0.png", &expected[1]);
    folder.run(&format!("{line} --resume")).refused(&["f0.png", "f%d.png.frames does not state"]);
    folder.write("f0.png", &expected[0]);
    let (mut file, _) = moving(3.0);
    // The animation does not move this node.
    file["nodes"][1]["translation"] = json!([0.0, 1.25, 0.0]);
    folder.write("moving.gltf", file.to_string());
    folder.run(&format!("{line} --resume")).refused(&["f0.png", "another pose"]);
    folder.write("moving.gltf", moving(3.0).0.to_string());
    let list = folder.text("f%d.png.frames");
    folder.write("f%d.png.frames", &list[..list.len() / 8]);
    folder.run(&format!("{line} --resume")).refused(&["f%d.png.frames does not state"]);
    folder.write("f%d.png.frames", list);
    // What does not change a pixel may differ.
    let facts = folder.run(&format!("{line} --resume --update rebuild --threads 1 --json")).done().json();
    assert_eq!(facts["kept_frames"], 3);
    assert_eq!(all(), expected);
    assert!(!folder.path("f%d.png.frames").exists());
}

/// A finished sequence has no list: its first and its last frame are rendered again and compared.
#[test]
fn a_finished_sequence_is_checked_by_its_pictures() {
    let folder = folder(3.0);
    let line = format!("render moving.gltf {QUICK} {SEQUENCE} 0..3");
    folder.run(&line).done();
    let names = folder.names();
    assert!(!names.iter().any(|name| name.contains("frames")), "{names:?}");
    let all = || [0, 1, 2].map(|n| folder.bytes(&format!("f{n}.png")));
    let expected = all();
    // The scene chooses the hybrid integrator, and two levels give the same pixels.
    let differs = |other: &str| !["--levels two", "--integrator hybrid"].contains(&other);
    for (other, _) in OTHERS.into_iter().filter(|(other, _)| differs(other)) {
        folder
            .run(&with(&line, other))
            .refused(&["differs from the picture of these options", "render without --resume"]);
        assert_eq!((all(), folder.names()), (expected.clone(), names.clone()), "{other}");
    }
    // What does not change a pixel may differ, and more frames are added to those that exist.
    for (end, options, kept) in [(3, "--levels two --integrator hybrid", 3), (5, "", 3), (5, "", 5)] {
        let line = format!("{} --resume --json {options}", line.replace("0..3", &format!("0..{end}")));
        assert_eq!(folder.run(&line).done().json()["kept_frames"], kept);
    }
    folder.write("f0.png", &expected[1]);
    folder.run(&format!("{line} --resume")).refused(&["f0.png", "differs"]);
}
