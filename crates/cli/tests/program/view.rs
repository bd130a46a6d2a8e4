//! `canted view --replay`: events in, pictures and commands out.

use serde_json::Value;

use crate::support::Folder;

const LINE: &str = "view small.obj --size 64x48 --spp 4 --replay events.toml --frames out";

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
    for (i, event) in events.iter().enumerate().take(10).skip(1) {
        assert!(pictures[i] != pictures[i - 1], "{event} changes nothing");
    }
    let size = image::load_from_memory(&pictures[4]).unwrap();
    assert_eq!((size.width(), size.height()), (50, 40));
    assert!(pictures[13] == pictures[14], "the picture stays when the window closes");
}

/// A session that is replayed again gives the same bits, and its first view is that of `canted render`.
#[test]
fn sessions_repeat_and_start_where_render_does() {
    let folder = Folder::with_small();
    let events = ["key = \"c\"", "key = \"left\"", "key = \"home\"", "key = \"p\""];
    let facts = replayed(&folder, LINE, &events);
    let first: Vec<Vec<u8>> = (1..=4).map(|i| folder.bytes(&format!("out/event_00{i}.png"))).collect();
    assert_eq!(words(&facts[0]), "render small.obj --device=cpu --size=64x48 --spp=4");
    folder.run("render small.obj --size 64x48 --spp 4 --device cpu -o start.png").done();
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
