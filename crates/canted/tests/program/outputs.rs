//! Outputs appear whole under their name, or not at all.

use std::fs;

use crate::support::Folder;

const RAYS: &str = "0.5,0.5,5,0,0,-1,9\n";

/// Every command line that writes, with `OUT` where the file's name goes.
const WRITERS: [&str; 4] = [
    "render small.obj --size 8x8 --spp 1 -o OUT.png",
    "cast small.obj --rays rays.csv --hits OUT.csv",
    "tree small.obj --codes OUT.csv --nodes nodes.csv",
    "tree small.obj --codes codes.csv --nodes OUT.csv",
];

fn folder() -> Folder {
    let folder = Folder::with_small();
    folder.write("rays.csv", RAYS);
    folder
}

#[test]
fn a_missing_folder_is_named() {
    for line in WRITERS {
        let folder = folder();
        folder.run(&line.replace("OUT", "missing/out")).refused(&["cannot write missing/out", "no such"]);
        assert_eq!(folder.names(), ["rays.csv", "small.obj"], "{line}");
    }
}

#[test]
fn a_folder_is_no_output() {
    for line in WRITERS {
        let folder = folder();
        for name in ["out.png", "out.csv"] {
            fs::create_dir(folder.path(name)).unwrap();
        }
        folder.run(&line.replace("OUT", "out")).refused(&["out", "folder"]);
        assert_eq!(folder.names(), ["out.csv", "out.png", "rays.csv", "small.obj"], "{line}");
    }
}

#[cfg(unix)]
#[test]
fn a_folder_that_cannot_be_written_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder();
    let locked = folder.path("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o555)).unwrap();
    // The system's own folder of processes refuses even the superuser, whom permissions do not stop.
    let refuses_us = fs::write(locked.join("probe"), "").is_err();
    let name = if refuses_us { "locked/out" } else { "/proc/out" };
    for line in WRITERS {
        folder.run(&line.replace("OUT", name)).refused(&["cannot write", name]);
    }
}

#[test]
fn what_stood_there_before_survives_a_failure() {
    let folder = folder();
    for name in ["out.png", "out.csv", "nodes.csv", "codes.csv"] {
        folder.write(name, "precious");
    }
    folder.write("small.obj", "f 1 2 3\n");
    for line in WRITERS {
        folder.run(&line.replace("OUT", "out")).refused(&["small.obj"]);
    }
    for name in ["out.png", "out.csv", "nodes.csv", "codes.csv"] {
        assert_eq!(folder.text(name), "precious", "{name}");
    }
    assert_eq!(folder.names(), ["codes.csv", "nodes.csv", "out.csv", "out.png", "rays.csv", "small.obj"]);
}

#[test]
fn success_replaces_what_stood_there_and_leaves_nothing_beside_it() {
    let folder = folder();
    for line in WRITERS {
        folder.write("out.png", "old");
        folder.write("out.csv", "old");
        folder.run(&line.replace("OUT", "out")).done();
        let written = if line.starts_with("render") { "out.png" } else { "out.csv" };
        assert_ne!(folder.bytes(written), b"old", "{line}");
    }
    assert_eq!(folder.names(), ["codes.csv", "nodes.csv", "out.csv", "out.png", "rays.csv", "small.obj"]);
}

#[test]
fn one_name_is_not_two_files() {
    let folder = folder();
    folder.run("tree small.obj --codes both.csv --nodes both.csv").refused(&["--codes", "--nodes", "both.csv"]);
    folder.run("tree small.obj --codes both.csv --nodes ./both.csv").refused(&["--codes", "--nodes", "./both.csv"]);
    folder.run("cast small.obj --rays rays.csv --hits ./rays.csv").refused(&["--rays", "--hits", "./rays.csv"]);
    folder.run("render small.obj -o a.exr --checkpoint a.exr").refused(&["--output", "--checkpoint", "a.exr"]);
    assert_eq!(folder.names(), ["rays.csv", "small.obj"]);
    assert_eq!(folder.text("rays.csv"), RAYS);
    folder.run("render small.obj --size 4x4 --spp 1 -o a.png").done();
    folder.run("compare a.png a.png --errors ./a.png").refused(&["--errors", "./a.png"]);
}

/// Whatever a command reads is still there afterwards, however the output's name leads to it.
#[test]
fn inputs_are_not_replaced() {
    let folder = folder();
    let own = "[[assets]]\nname = 'small'\nfile = 'small.obj'\n[environment]\nimage = 'sky.exr'\n";
    folder.write("s.toml", own);
    folder.run("render small.obj --size 8x4 --spp 1 -o sky.exr").done();
    for range in ["0..1", "1..2"] {
        folder.run(&format!("render small.obj --size 8x4 --samples {range} -o {}.exr", &range[..1])).done();
    }
    let mut cases = vec![
        ("merge 0.exr 1.exr -o ./1.exr", "1.exr", ["a part", "--output"]),
        ("render small.obj --env sky.exr -o ./sky.exr", "sky.exr", ["--env", "--output"]),
        ("render s.toml -o sky.exr", "sky.exr", ["s.toml", "--output"]),
        ("render small.obj --checkpoint small.obj -o a.exr", "small.obj", ["SCENE", "--checkpoint"]),
        ("scene s.toml -o ./s.toml", "s.toml", ["SCENE", "--output"]),
        ("tree small.obj --codes ./small.obj --nodes n.csv", "small.obj", ["SCENE", "--codes"]),
        ("tree s.toml --codes c.csv --nodes small.obj", "small.obj", ["s.toml", "--nodes"]),
    ];
    // What a scene names, and what a scene file's scenes do.
    folder.run("render small.obj --size 8x4 --spp 1 -o t.png").done();
    folder.write("t.mtl", "newmtl a\nmap_Kd t.png\n");
    folder.write("t.obj", "mtllib t.mtl\nusemtl a\n".to_owned() + crate::support::SMALL);
    folder.write("t.toml", "[[assets]]\nname = 't'\nfile = 't.obj'\n");
    folder.write(
        "t.ply",
        "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 3\nproperty float x\nproperty float y\n\
         property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    );
    folder.write("t.bin", [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat());
    folder.write(
        "t.gltf",
        r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"uri": "t.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "accessors": [{"bufferView": 0, "componentType": 5126,
        "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}]}"#,
    );
    cases.extend([
        ("render t.ply -o t.png", "t.png", ["what t.ply names", "--output"]),
        ("cast t.gltf --rays rays.csv --hits t.bin", "t.bin", ["what t.gltf names", "--hits"]),
        ("render t.obj -o ./t.png", "t.png", ["what t.obj names", "--output"]),
        ("render t.obj --checkpoint t.mtl -o a.png", "t.mtl", ["what t.obj names", "--checkpoint"]),
        ("render t.toml -o t.png", "t.png", ["what t.toml names", "--output"]),
        ("tree t.obj --codes t.mtl --nodes n.csv", "t.mtl", ["what t.obj names", "--codes"]),
    ]);
    if cfg!(unix) {
        #[cfg(unix)]
        for (file, link) in [("0.exr", "part.exr"), ("rays.csv", "hits.csv")] {
            std::os::unix::fs::symlink(file, folder.path(link)).unwrap();
        }
        cases.push(("merge 0.exr 1.exr -o part.exr", "0.exr", ["a part", "--output"]));
        cases.push(("cast small.obj --rays rays.csv --hits hits.csv", "rays.csv", ["--rays", "--hits"]));
    }
    let names = folder.names();
    for (line, file, words) in cases {
        let before = folder.bytes(file);
        folder.run(line).refused(&words);
        assert!(folder.bytes(file) == before, "{line}");
    }
    assert_eq!(folder.names(), names);
}

/// Devices and pipes are no files that a result may replace: for the superuser `/dev/null` would become one.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_replaced() {
    let folder = folder();
    let is_file = |name: &str| fs::symlink_metadata(folder.path(name)).unwrap().is_file();
    let _sockets =
        ["out.png", "out.csv"].map(|name| std::os::unix::net::UnixListener::bind(folder.path(name)).unwrap());
    for line in WRITERS {
        folder.run(&line.replace("OUT", "out")).refused(&["cannot write out", "no regular file"]);
    }
    folder.run("render small.obj -o a.png --checkpoint out.csv").refused(&["cannot write out.csv"]);
    assert!(!is_file("out.png") && !is_file("out.csv"));
}

/// Results that nobody can have are no success; a reader that has read enough is one.
#[cfg(target_os = "linux")]
#[test]
fn standard_output_that_is_full_is_an_error() {
    let folder = folder();
    let run = |out: &str| {
        let out = fs::File::create(out).unwrap();
        folder.command("stats small.obj --json").stdout(out).output().unwrap()
    };
    let full = run("/dev/full");
    let message = String::from_utf8(full.stderr).unwrap();
    assert_eq!(full.status.code(), Some(2), "{message}");
    assert!(message.starts_with("error: cannot write standard output"), "{message}");
    assert_eq!(run("/dev/null").status.code(), Some(0));
}

#[cfg(unix)]
pub(crate) mod interrupted {
    use std::{
        os::unix::process::ExitStatusExt,
        process::{Child, Command, Stdio},
        thread::sleep,
        time::{Duration, Instant},
    };

    use canted_fixtures::skip;

    use crate::{random::Random, support::Folder};

    /// Waits until `is_true`, for a minute at most.
    pub(crate) fn wait_until(mut is_true: impl FnMut() -> bool) {
        let start = Instant::now();
        while !is_true() {
            assert!(start.elapsed() < Duration::from_secs(60), "waited for a minute");
            sleep(Duration::from_millis(10));
        }
    }

    /// Whether Ctrl-C does nothing here, as under `nohup`: programs inherit that and keep it, so the test is skipped by name.
    pub(crate) fn is_ignored(test: &str) -> bool {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        let is_ignored = mask.is_some_and(|mask| mask >> 1 & 1 == 1);
        if is_ignored {
            skip::<()>(test, "Ctrl-C is ignored where the tests were started");
        }
        is_ignored
    }

    /// Sends Ctrl-C; the exit code as a shell shows it.
    pub(crate) fn interrupt(child: &mut Child) -> Option<i32> {
        send("-INT", child)
    }

    /// Sends a signal, as above.
    pub(crate) fn send(signal: &str, child: &mut Child) -> Option<i32> {
        assert!(child.try_wait().unwrap().is_none(), "the work was over too soon");
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        wait_until(|| child.try_wait().unwrap().is_some());
        let status = child.wait().unwrap();
        status.code().or_else(|| status.signal().map(|signal| 128 + signal))
    }

    /// Whether the process catches a signal, by the mask of those it does; `None` where the system does not say.
    pub(crate) fn catches(signal: &str, child: &Child) -> Option<bool> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
        assert!(!status.contains("\nState:\tZ"), "the work was over too soon");
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?;
        let (_, bit) = [("HUP", 0), ("INT", 1), ("TERM", 14)].into_iter().find(|&(name, _)| name == signal)?;
        Some(u64::from_str_radix(mask.trim(), 16).ok()? >> bit & 1 == 1)
    }

    #[test]
    fn a_render_ends_with_130_and_leaves_nothing() {
        if is_ignored("a_render_ends_with_130_and_leaves_nothing") {
            return;
        }
        let folder = Folder::with_small();
        // Before there is anything to stop, and while rays are traced.
        for milliseconds in [0, 2000] {
            let mut command = folder.command("render small.obj -o out.png --size 1024x1024 --spp 1048576");
            let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
            wait_until(|| catches("INT", &child).unwrap_or(true));
            sleep(Duration::from_millis(milliseconds));
            assert_eq!(interrupt(&mut child), Some(130));
            assert_eq!(folder.names(), ["small.obj"]);
        }
    }

    /// Where a scene is still read, by the bytes that the process has read, nothing looks at a flag.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_render_that_still_reads_ends_with_130() {
        if is_ignored("a_render_that_still_reads_ends_with_130") {
            return;
        }
        let folder = Folder::new();
        let scene = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned() + &"f 1 2 3\n".repeat(3_000_000);
        folder.write("many.obj", &scene);
        for signal in ["-INT", "-TERM"] {
            let mut child = folder.command("render many.obj -o out.png --device cpu").spawn().unwrap();
            let n_read = || {
                let counts = std::fs::read_to_string(format!("/proc/{}/io", child.id())).unwrap();
                let all = counts.lines().find_map(|line| line.strip_prefix("rchar: ")?.parse::<usize>().ok());
                all.unwrap()
            };
            wait_until(|| n_read() > scene.len());
            assert_eq!(send(signal, &mut child), Some(130), "{signal}");
            assert_eq!(folder.names(), ["many.obj"], "{signal}");
        }
    }

    /// A driver that is being set up is left as it is: what it does at an exit would take apart what it still makes.
    #[test]
    fn a_search_for_devices_is_interrupted_without_a_crash() {
        if is_ignored("a_search_for_devices_is_interrupted_without_a_crash") {
            return;
        }
        let folder = Folder::with_small();
        for milliseconds in (0..120).step_by(4) {
            let mut child = folder.command("devices").stdout(Stdio::null()).spawn().unwrap();
            sleep(Duration::from_millis(milliseconds));
            assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
            let status = child.wait().unwrap();
            // It may be over already, or not have begun to catch signals.
            let is_sane = matches!(status.code(), Some(0 | 130)) || status.signal() == Some(15);
            assert!(is_sane, "after {milliseconds} ms: {status}");
        }
    }

    #[test]
    fn a_cast_ends_with_130_and_leaves_nothing() {
        if is_ignored("a_cast_ends_with_130_and_leaves_nothing") {
            return;
        }
        let folder = Folder::new();
        // Triangles that all lie in each other, so that a ray tests every one of them.
        let mut random = Random(5);
        let corners: String =
            (0..3 * 3000).map(|_| random.point(1000)).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        let faces: String = (0..3000).map(|i| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3)).collect();
        folder.write("tangle.obj", corners + &faces);
        folder.write("rays.csv", "-2000,0.5,0.5,1,0.01,0.01,inf\n".repeat(2_000_000));
        let mut child = folder.command("cast tangle.obj --rays rays.csv --hits hits.csv --threads 1").spawn().unwrap();
        sleep(Duration::from_millis(500));
        assert_eq!(interrupt(&mut child), Some(130));
        assert_eq!(folder.names(), ["rays.csv", "tangle.obj"]);
    }

    /// Whoever writes is interrupted in the middle, by Ctrl-C or what a scheduler sends.
    #[test]
    fn nothing_half_written_remains() {
        if is_ignored("nothing_half_written_remains") {
            return;
        }
        let folder = Folder::with_small();
        let ray: Vec<u8> = [9.0f32, 9.0, 9.0, 0.0, 0.0, 1.0, 1.0].into_iter().flat_map(f32::to_le_bytes).collect();
        folder.write("rays.bin", ray.repeat(3_000_000));
        folder.write("many.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned() + &"f 1 2 3\n".repeat(1_500_000));
        // The first temporary files only prove that the place can be written.
        for (line, n_probes) in [
            ("cast small.obj --rays rays.bin --hits hits.csv --device cpu", 1),
            ("tree many.obj --codes codes.csv --nodes nodes.csv", 2),
        ] {
            for signal in ["-INT", "-TERM"] {
                let mut child = folder.command(line).spawn().unwrap();
                let temporary = folder.path(&format!(".canted-{}-{n_probes}.tmp", child.id()));
                wait_until(|| temporary.exists() || child.try_wait().unwrap().is_some());
                assert_eq!(send(signal, &mut child), Some(130), "{line}, {signal}");
                assert_eq!(folder.names(), ["many.obj", "rays.bin", "small.obj"], "{line}, {signal}");
            }
        }
    }
}
