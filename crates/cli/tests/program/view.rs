//! `canted view --replay`: events in, pictures and commands out.

use serde_json::Value;

use crate::support::Folder;

const LINE: &str = "view small.obj --size 64x48 --spp 4 --replay events.toml --frames out";

/// A triangle that rises by 1 within a second. The buffer holds three vertices, two times and two translations.
const RISING: &str = r#"{
  "asset": { "version": "2.0" },
  "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
  "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
  "animations": [{ "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
                   "samplers": [{ "input": 1, "output": 2 }] }],
  "buffers": [{ "byteLength": 68, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAAAACAPwAAAAA=" }],
  "bufferViews": [{ "buffer": 0, "byteOffset": 0, "byteLength": 36 }, { "buffer": 0, "byteOffset": 36, "byteLength": 8 },
                  { "buffer": 0, "byteOffset": 44, "byteLength": 24 }],
  "accessors": [
    { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
    { "bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1] },
    { "bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3" }]
}"#;

/// Replays events; returns the report, a line for each event.
#[track_caller]
fn replayed(folder: &Folder, line: &str, events: &[&str]) -> Vec<Value> {
    let tables = events.iter().enumerate().map(|(i, event)| format!("[[event]]\nat_s = {i}\n{event}\n"));
    folder.write("events.toml", tables.collect::<String>());
    let stdout = folder.run(&format!("{line} --json")).done().stdout;
    let facts: Vec<Value> = stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(facts.len(), events.len());
    facts
}

/// The words of a command without quotes, after the program's name and before the output.
fn words(fact: &Value) -> String {
    let command = fact["command"].as_str().unwrap();
    command.strip_prefix("canted ").unwrap().split(" -o ").next().unwrap().to_owned()
}

/// Every settled picture is that of its command, to the byte.
#[test]
fn pictures_are_those_of_their_commands() {
    let folder = Folder::with_small();
    let events = [
        "drag = [10, 10, 30, 15]",
        "scroll = 2",
        "key = \"w\"",
        "drag = [0, 0, 5, 9]\nbutton = \"right\"",
        "resize = [50, 40]",
        "set = { tone_map = \"agx\", exposure = 1 }",
        "set = { accel = \"bvh2\", volumes = \"dop\", integrator = \"path\" }",
        "key = \"h\"",
        "set = { heatmap = \"none\", ortho = \"3\", fov = \"\" }",
        "scroll = -1.5",
        "key = \"x\"",
        "key = \"b\"",
        "set = { boxes = \"leaves\", volumes = \"pca-bounded\", accel = \"bvh2\" }",
        "set = { boxes = \"none\", volumes = \"\", accel = \"kdtree\" }",
        "set = { sun = \"0,-1,0,3,3,3\", triangles = \"moller-trumbore\" }",
        "key = \"home\"",
        "set = { noise = 0.05 }",
        "close = true",
    ];
    let facts = replayed(&folder, LINE, &events);
    let mut pictures = Vec::new();
    for (i, (fact, event)) in facts.iter().zip(events).enumerate() {
        let name = format!("out/event_{:03}.png", i + 1);
        assert_eq!(fact["picture"], name);
        folder.run(&format!("{} -o render.png -q", words(fact))).done();
        assert!(folder.bytes(&name) == folder.bytes("render.png"), "{event}: {fact}");
        pictures.push(folder.bytes(&name));
    }
    // A structure changes no picture.
    for i in (1..10).chain(11..14) {
        assert!(pictures[i] != pictures[i - 1], "{} changes nothing", events[i]);
    }
    let size = image::load_from_memory(&pictures[4]).unwrap();
    assert_eq!((size.width(), size.height()), (50, 40));
    assert!(pictures[16] == pictures[17], "the picture stays when the window closes");
}

/// A session that is replayed again gives the same bits, and its first view is that of `canted render`.
#[test]
fn sessions_repeat_and_start_where_render_does() {
    let folder = Folder::with_small();
    let events = ["key = \"c\"", "key = \"left\"", "key = \"home\"", "key = \"p\""];
    let facts = replayed(&folder, LINE, &events);
    let first: Vec<Vec<u8>> = (1..=4).map(|i| folder.bytes(&format!("out/event_00{i}.png"))).collect();
    assert_eq!(words(&facts[0]), "render small.obj --device=cpu --size=64x48 --spp=4 --denoise=off");
    folder.run("render small.obj --size 64x48 --spp 4 --device cpu --denoise off -o start.png").done();
    let start = folder.bytes("start.png");
    assert!(
        first[0] == start && first[1] != start && first[2] == start && folder.bytes("out/screenshot_001.png") == start
    );
    replayed(&folder, LINE, &events);
    let second: Vec<Vec<u8>> = (1..=4).map(|i| folder.bytes(&format!("out/event_00{i}.png"))).collect();
    assert!(first == second);
}

#[test]
fn clicks_and_channels_show_what_is_there() {
    let folder = Folder::with_small();
    let line = format!("{LINE} --eye 0.5,0.4,5 --target 0.5,0.4,0 --fov 20");
    let events =
        ["click = [44, 14]", "click = [0, 0]", "key = \"v\"", "set = { aov = \"normal\" }", "set = { aov = \"none\" }"];
    let facts = replayed(&folder, &line, &events);
    let hit = &facts[0]["hit"];
    // The floor is at z = 0, 5 units away; the ray to a corner of the picture is longer.
    assert_eq!((hit["instance"].as_u64(), hit["primitive"].as_u64()), (Some(0), Some(0)), "{hit}");
    assert!((hit["t"].as_f64().unwrap() - 5.04).abs() < 0.05, "{hit}");
    assert!(hit["material"].is_string() && hit["barycentric"][1].is_number());
    assert!(facts[1]["hit"].is_null(), "{}", facts[1]);
    assert!(words(&facts[2]).ends_with("--aovs=depth"), "{}", facts[2]);
    let pictures: Vec<_> = (1..=5).map(|i| folder.bytes(&format!("out/event_00{i}.png"))).collect();
    assert!(pictures[1] != pictures[2] && pictures[2] != pictures[3] && pictures[1] == pictures[4]);
}

/// Passes on a GPU have the bits of `canted render` there; what the device does not support, the CPU renders, and the command says so.
#[test]
fn sessions_on_a_gpu_are_those_of_render() {
    if crate::gpu::adapter("sessions_on_a_gpu_are_those_of_render").is_none() {
        return;
    }
    let folder = Folder::with_small();
    let events = [
        "set = { device = \"gpu\" }",
        "drag = [10, 10, 30, 15]",
        "set = { integrator = \"path\" }",
        "set = { accel = \"bih\" }",
        "set = { accel = \"wide\", heatmap = \"boxes\" }",
        "set = { heatmap = \"none\", noise = 0.05 }",
    ];
    let facts = replayed(&folder, LINE, &events);
    let devices = ["gpu", "gpu", "gpu", "cpu", "cpu", "gpu"];
    for (i, (fact, device)) in facts.iter().zip(devices).enumerate() {
        let words = words(fact);
        assert!(words.contains(&format!("--device={device} ")), "{words}");
        folder.run(&format!("{words} -o render.png -q")).done();
        assert!(folder.bytes(&format!("out/event_00{}.png", i + 1)) == folder.bytes("render.png"), "{words}");
    }
    let run = folder.run(&format!("{LINE} --device gpu --accel bih")).done();
    assert!(run.stderr.contains("the CPU renders: --accel bih is not supported on the GPU"), "{}", run.stderr);
    folder.run(&format!("{LINE} --device both")).refused(&["--device both requires `canted render`"]);
    folder.run(&format!("{LINE} --device none-such")).done();
}

/// Animations keep the view while their time changes.
#[test]
fn times_keep_the_view() {
    let folder = Folder::new();
    folder.write("rise.gltf", RISING);
    let line = "view rise.gltf --size 48x32 --spp 2 --replay events.toml --frames out";
    let events =
        ["key = \"c\"", "set = { time = 0.5 }", "set = { time = 1 }", "set = { time = 7 }", "set = { time = \"\" }"];
    let facts = replayed(&folder, line, &events);
    let pictures: Vec<_> = (1..=5).map(|i| folder.bytes(&format!("out/event_00{i}.png"))).collect();
    for (i, fact) in facts.iter().enumerate() {
        folder.run(&format!("{} -o render.png -q", words(fact))).done();
        assert!(pictures[i] == folder.bytes("render.png"), "{fact}");
    }
    let eye = |fact: &Value| words(fact).split(" --eye=").nth(1).map(|rest| rest.split(' ').next().unwrap().to_owned());
    assert!(eye(&facts[1]).is_some() && eye(&facts[1]) == eye(&facts[3]), "{} {}", facts[1], facts[3]);
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
    assert!(pictures[2] == pictures[3], "poses after the end are that of the end");
    assert!(pictures[4] == pictures[0], "the rest pose, in the same view");
}

/// A time that a file does not have is reported as `canted render` reports it.
#[test]
fn times_are_those_of_render() {
    let folder = Folder::with_small();
    folder.write("events.toml", "[[event]]\nat_s = 0\nset = { time = 0.5 }\n");
    let (view, render) = (folder.run(LINE), folder.run("render small.obj --time 0.5 --size 16x9 --spp 1"));
    assert_eq!(view.code, render.code);
    if let Some(reason) = render.stderr.trim().strip_prefix("error: ") {
        view.refused(&["events.toml: event 1: ", reason]);
    }
}

#[test]
fn bad_events_are_errors_of_one_sentence() {
    let folder = Folder::with_small();
    for (event, words) in [
        ("at_s = -1\nkey = \"w\"", &["event 1: at_s = -1"][..]),
        ("at_s = 0", &["event 1: no action"]),
        ("at_s = 0\nkey = \"w\"\nscroll = 1", &["event 1: 2 actions"]),
        ("at_s = 0\nset = { sppp = \"1\" }", &["event 1: unknown option 'sppp'; did you mean 'spp'?"]),
        ("at_s = 0\nset = { spp = \"0\" }", &["event 1: invalid value '0'"]),
        ("at_s = 0\nset = { output = \"a.png\" }", &["event 1: unknown option 'output'"]),
        ("at_s = 0\nclick = [64, 0]", &["event 1: click [64, 0] is outside the picture of 64 x 48"]),
        ("at_s = 0\nset = { accel = \"bih\", volumes = \"dop\" }", &["event 1: --volumes dop requires --accel bvh2"]),
    ] {
        folder.write("events.toml", format!("[[event]]\n{event}\n"));
        folder.run(LINE).refused(&[words, &["events.toml: "]].concat());
    }
    folder.run("view small.obj --replay none.toml --frames out").refused(&["none.toml"]);
    folder.run("view none.obj --replay events.toml --frames out").refused(&["none.obj"]);
    folder.run("view small.obj --replay events.toml").refused(&["--frames"]);
    if !cfg!(feature = "view") {
        folder.run("view small.obj").refused(&["cargo run --release --features view -- view"]);
    }
}
