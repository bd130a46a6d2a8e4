//! Output files are written completely or not at all.

use std::fs;

use crate::support::Folder;

const RAYS: &str = "0.5,0.5,5,0,0,-1,9\n";

/// Commands that write a file; `OUT` stands for its name.
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
fn a_missing_folder_is_reported() {
    for line in WRITERS {
        let folder = folder();
        folder.run(&line.replace("OUT", "missing/out")).refused(&["cannot write missing/out", "no such"]);
        assert_eq!(folder.names(), ["rays.csv", "small.obj"], "{line}");
    }
}

#[test]
fn a_folder_is_rejected_as_output() {
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
fn a_read_only_folder_is_reported() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder();
    let locked = folder.path("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o555)).unwrap();
    // Permissions do not apply to the superuser, but nobody can create files in /proc.
    let is_read_only = fs::write(locked.join("probe"), "").is_err();
    let name = if is_read_only { "locked/out" } else { "/proc/out" };
    for line in WRITERS {
        folder.run(&line.replace("OUT", name)).refused(&["cannot write", name]);
    }
}

#[test]
fn a_failure_keeps_existing_files() {
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
fn success_replaces_existing_files_and_leaves_no_others() {
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
fn two_options_cannot_name_the_same_file() {
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

/// Whatever path leads to an input, no output replaces it.
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
        ("merge 0.exr 1.exr -o ./1.exr", "1.exr", ["PART", "--output"]),
        ("render small.obj --env sky.exr -o ./sky.exr", "sky.exr", ["--env", "--output"]),
        ("render s.toml -o sky.exr", "sky.exr", ["s.toml", "--output"]),
        ("render small.obj --checkpoint small.obj -o a.exr", "small.obj", ["SCENE", "--checkpoint"]),
        ("scene s.toml -o ./s.toml", "s.toml", ["SCENE", "--output"]),
        ("tree small.obj --codes ./small.obj --nodes n.csv", "small.obj", ["SCENE", "--codes"]),
        ("tree s.toml --codes c.csv --nodes small.obj", "small.obj", ["s.toml", "--nodes"]),
    ];
    // Files that a scene refers to, directly or through a scene file.
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
        ("render t.ply -o t.png", "t.png", ["an input of t.ply", "--output"]),
        ("cast t.gltf --rays rays.csv --hits t.bin", "t.bin", ["an input of t.gltf", "--hits"]),
        ("render t.obj -o ./t.png", "t.png", ["an input of t.obj", "--output"]),
        ("render t.obj --checkpoint t.mtl -o a.png", "t.mtl", ["an input of t.obj", "--checkpoint"]),
        ("render t.toml -o t.png", "t.png", ["an input of t.toml", "--output"]),
        ("tree t.obj --codes t.mtl --nodes n.csv", "t.mtl", ["an input of t.obj", "--codes"]),
    ]);
    if cfg!(unix) {
        #[cfg(unix)]
        for (file, link) in [("0.exr", "part.exr"), ("rays.csv", "hits.csv")] {
            std::os::unix::fs::symlink(file, folder.path(link)).unwrap();
        }
        cases.push(("merge 0.exr 1.exr -o part.exr", "0.exr", ["PART", "--output"]));
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

/// Devices and pipes are not replaced: the superuser could replace `/dev/null`.
#[cfg(unix)]
#[test]
fn only_regular_files_are_replaced() {
    let folder = folder();
    let is_file = |name: &str| fs::symlink_metadata(folder.path(name)).unwrap().is_file();
    let _sockets =
        ["out.png", "out.csv"].map(|name| std::os::unix::net::UnixListener::bind(folder.path(name)).unwrap());
    for line in WRITERS {
        folder.run(&line.replace("OUT", "out")).refused(&["cannot write out", "not a regular file"]);
    }
    folder.run("render small.obj -o a.png --checkpoint out.csv").refused(&["cannot write out.csv"]);
    assert!(!is_file("out.png") && !is_file("out.csv"));
}

/// A full disk is an error; a closed pipe is not.
#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error() {
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
