//! The command line: help, `canted FILE`, `-q`, `-v`, streams; messages and exit codes for invalid options, inputs and outputs.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    process::{Output, Stdio},
};

use canted_fixtures::skip;

use crate::support::{BUILDERS, Folder};

/// Runs a command with bytes on standard input.
fn piped(folder: &Folder, line: &str, input: &[u8]) -> Output {
    let mut child =
        folder.command(line).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn a_file_is_rendered_to_a_picture_of_its_name() {
    let folder = Folder::with_small();
    folder.run("small.obj --size 8x8 --spp 1 --device cpu").done();
    folder.run("-q --size 8x8 --spp 1 --device cpu small.obj -o other.png").done();
    assert_eq!(folder.names(), ["other.png", "small.obj", "small.png"]);
    assert_eq!(folder.bytes("small.png"), folder.bytes("other.png"));
    folder.run("missing.obj").refused(&["missing.obj"]);
    folder.run("dance").refused(&["dance"]);
}

#[test]
fn quiet_prints_results_and_errors_only() {
    let folder = Folder::new();
    folder.write("nan.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n");
    let line = "render nan.obj --size 8x8 --spp 1 --device cpu";
    assert_eq!(folder.run(line).done().n_warnings(), 1);
    let quiet = folder.run(&format!("{line} --quiet")).done();
    assert_eq!((quiet.stdout.as_str(), quiet.stderr.as_str()), ("", ""));
    assert!(folder.run(&format!("-q {line} --json")).done().json()["rays"].is_u64());
    assert!(folder.run(&format!("-v {line}")).done().stderr.contains("detail: scene read in "));
    folder.run("render nan.obj -q --size 0x8").refused(&["--size"]);
    folder.run("-q -v devices").refused(&["--verbose"]);
}

#[test]
fn rays_and_hits_are_streams() {
    let folder = Folder::with_small();
    let rays = b"0.25,0.25,9,0,0,-1,inf\n5,5,9,0,0,-1,inf\n";
    folder.write("rays.csv", rays);
    folder.run("cast small.obj --rays rays.csv --hits hits.csv --device cpu").done();
    let line = "cast small.obj --rays - --hits - --device cpu";
    let csv = piped(&folder, line, rays);
    assert_eq!(csv.stdout, folder.bytes("hits.csv"));
    let binary: Vec<u8> = [0.25_f32, 0.25, 9.0, 0.0, 0.0, -1.0, 99.0].into_iter().flat_map(f32::to_le_bytes).collect();
    let bin = piped(&folder, &format!("{line} --format bin"), &binary);
    assert_eq!((bin.status.code(), bin.stdout.len()), (Some(0), 16), "{}", String::from_utf8_lossy(&bin.stderr));
    assert_eq!(bin.stdout[..4], 8.0_f32.to_le_bytes());
    let wrong = piped(&folder, line, b"1,2\n");
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("standard input: line 1: expected 7 fields"));
    folder.run(&format!("{line} --json")).refused(&["--hits -", "--json"]);
    assert_eq!(folder.names(), ["hits.csv", "rays.csv", "small.obj"]);
}

#[test]
fn a_picture_is_written_to_standard_output() {
    let folder = Folder::with_small();
    let line = "render small.obj --size 8x6 --spp 1 --device cpu";
    folder.run(&format!("{line} -o a.png")).done();
    let stream = folder.command(&format!("{line} -o -")).output().unwrap();
    assert_eq!(stream.stdout, folder.bytes("a.png"));
    let hdr = folder.command(&format!("{line} -o - --format hdr")).output().unwrap();
    assert!(hdr.stdout.starts_with(b"#?RADIANCE"));
    folder.run(&format!("{line} -o - --json")).refused(&["-o -", "--json"]);
    folder.run(&format!("{line} -o - --format exr --aovs depth")).refused(&["--aovs", "not -"]);
}

#[test]
fn completions_and_manual_pages_name_all_subcommands() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "powershell"] {
        let text = folder.run(&format!("completions {shell}")).done().stdout;
        for word in ["render", "merge", "tone-map"] {
            assert!(text.contains(word), "{shell}: {word}");
        }
    }
    folder.run("completions ksh").refused(&["ksh", "bash"]);
    let page = folder.run("man").done().stdout;
    assert!(page.contains(".TH canted") && page.contains("render"), "{page}");
    assert!(folder.run("man render").done().stdout.contains("integrator"));
    folder.run("man dance").refused(&["'dance'"]);
}

#[test]
fn help_has_headings_examples_and_the_features_of_the_build() {
    let folder = Folder::new();
    let version = folder.run("--version").done();
    assert_eq!(version.stdout, format!("canted {}\n", env!("CARGO_PKG_VERSION")));
    let help = folder.run("--help").done().stdout;
    let line = help.lines().find(|line| line.starts_with("Features of this build: ")).unwrap();
    assert_eq!(line.contains("gpu"), cfg!(feature = "gpu"), "{line}");
    for command in ["render", "scene", "stats", "cast", "tree", "compare", "devices", "merge"] {
        assert!(help.contains(command), "{help}");
        let help = folder.run(&format!("{command} --help")).done().stdout;
        let examples = help.split("Examples:").nth(1).unwrap_or_else(|| panic!("{command}: {help}"));
        assert!(examples.matches(&format!("canted {command} ")).count() >= 2 || command == "devices", "{examples}");
    }
    let help = folder.run("render --help").done().stdout;
    for heading in ["Scene:", "Picture:", "Run:", "Frames:", "Rendering:", "Look", "Camera:", "Light", "Messages:"] {
        assert!(help.contains(heading), "{heading}");
    }
    assert_eq!(folder.names(), [""; 0]);
}

#[test]
fn only_near_misses_are_suggested() {
    let folder = Folder::with_small();
    let file = |key: &str| format!("[[assets]]\nname = 'a'\nfile = 'small.obj'\n[settings]\n{key} = 1\n");
    folder.write("near.toml", file("bounce"));
    folder.write("far.toml", file("elephant"));
    folder.run("render near.toml").refused(&["unknown key 'bounce'", "did you mean 'bounces'?"]);
    let far = folder.run("render far.toml").refused(&["unknown key 'elephant'"]);
    assert!(!far.stderr.contains("did you mean"), "{}", far.stderr);
}

// Exit codes and messages for invalid arguments.

#[test]
fn invalid_values_are_rejected_with_option_and_value() {
    let folder = Folder::with_small();
    let cases: &[(&str, &[&str])] = &[
        ("dance", &["dance"]),
        ("render --dance", &["--dance"]),
        ("render a.obj b.obj", &["b.obj"]),
        ("render --size 12", &["--size", "12"]),
        ("render --size 0x9", &["--size", "0"]),
        ("render --size 16x-9", &["--size", "-9"]),
        ("render --size -16x9", &["--size", "-16"]),
        ("render --spp -1", &["--spp", "-1"]),
        ("render --samples -1..4", &["--samples", "A..B"]),
        ("render --fov -30", &["--fov", "-30"]),
        ("render --noise -0.1", &["--noise", "-0.1"]),
        ("render --heatmap-scale 9", &["--heatmap"]),
        ("tree small.obj --bits -1 --codes c --nodes n", &["--bits", "-1"]),
        ("render --size 65536x65536", &["--size", "65536"]),
        ("render --size 99999999999x1", &["--size", "99999999999"]),
        ("render --spp 0", &["--spp", "0"]),
        ("render --spp many", &["--spp", "many"]),
        ("render --bounces 1.5", &["--bounces", "1.5"]),
        ("render --eye 1,2", &["--eye", "1,2"]),
        ("render --eye 1,2,nan", &["--eye", "nan"]),
        ("render --target 1,2,x", &["--target", "x"]),
        ("render --up inf,0,0", &["--up", "inf"]),
        ("render --fov 0", &["--fov", "0"]),
        ("render --fov 180", &["--fov", "180"]),
        ("render --fov nan", &["--fov", "nan"]),
        ("render --env 1,1", &["--env", "1,1"]),
        ("render --sun 1,1,1", &["--sun", "1,1,1"]),
        ("render --point 0,0,0,1,1,1e99", &["--point", "1e99"]),
        ("render --sphere 0,0,0,1,1,1", &["--sphere", "7 numbers"]),
        ("render --levels three", &["--levels", "three"]),
        ("render --builder embree", &[&["--builder", "embree"], BUILDERS].concat()),
        ("render --preset best", &["--preset", "best", "dynamic", "fast", "balanced", "quality"]),
        ("render --preset", &["--preset"]),
        ("cast small.obj --rays a.csv --hits b.csv --preset 3", &["--preset", "3"]),
        ("render --volumes spheres", &["--volumes", "spheres"]),
        ("render --accel octree", &["--accel", "octree", "wide", "bvh2", "bih", "kdtree"]),
        ("render --triangles quads", &["--triangles", "quads"]),
        ("render --heatmap rays", &["--heatmap", "rays"]),
        ("render --heatmap-scale 0", &["--heatmap-scale", "0"]),
        ("render --threads 0", &["--threads", "0"]),
        ("render --threads 100000", &["--threads", "100000"]),
        ("render --seed 4294967296", &["--seed", "4294967296"]),
        ("stats small.obj --presets fast,slow", &["--presets", "slow", "balanced"]),
        ("stats small.obj --presets ,", &["--presets"]),
        ("stats small.obj --time soon", &["--time", "soon"]),
        ("cast small.obj --rays a.csv --hits b.csv --time inf", &["--time", "inf"]),
        ("stats small.obj --threads two", &["--threads", "two"]),
        ("cast small.obj --rays a.csv", &["--hits"]),
        ("cast small.obj --hits a.csv", &["--rays"]),
        ("tree small.obj --bits 31 --codes c --nodes n", &["--bits", "31"]),
        ("compare a.png", &["<B>"]),
        ("compare a.png b.png --max much", &["--max", "much"]),
        ("compare a.png b.png --max nan", &["--max", "NaN"]),
        ("compare a.png b.png --max -1", &["--max", "-1"]),
    ];
    for (line, words) in cases {
        folder.run(line).refused(words);
    }
    assert_eq!(folder.names(), ["small.obj"], "nothing is written");
}

#[test]
fn values_that_are_invalid_for_the_scene_are_rejected() {
    let folder = Folder::with_small();
    let cases: &[(&str, &[&str])] = &[
        ("--eye 1,1,1 --target 1,1,1", &["target", "1"]),
        ("--eye 0,0,0 --target 0,1,0 --up 0,1,0", &["up"]),
        ("--up 0,0,0", &["up", "0"]),
        ("--env=-1,0,0", &["--env", "-1"]),
        ("--sun 0,0,0,1,1,1", &["--sun", "0,0,0", "direction is zero"]),
        ("--sun 0,-1,0,1,-2,1", &["--sun", "-2"]),
        ("--point 0,0,0,1,1,-3", &["--point", "-3"]),
        ("--sphere 0,9,0,0,1,1,1", &["--sphere", "radius 0"]),
        ("--sphere 0,9,0,1,1,1,-3", &["--sphere", "-3"]),
    ];
    for (options, words) in cases {
        folder.run(&format!("render small.obj -o out.png --size 8x8 --spp 1 {options}")).refused(words);
    }
    assert_eq!(folder.names(), ["small.obj"], "nothing is written");
}

/// An option without effect is rejected, or reported if it has an effect on other pictures.
#[test]
fn options_without_effect_are_reported() {
    let folder = Folder::with_small();
    let run = |options: &str| folder.run(&format!("render {options} --size 8x8 -o out.png"));
    run("small.obj --focus 3").refused(&["--focus requires a lens", "--aperture"]);
    run("small.obj --focus 3 --aperture 0").refused(&["--focus requires a lens", "--aperture"]);
    run("small.obj --focus 3 --aperture 0.1 --spp 1").done();
    run("small.obj --env 1,1,1 --env-turn 90").refused(&["--env-turn requires an environment map"]);
    run("small.obj --accel wide --volumes dop").refused(&["--volumes dop requires --accel bvh2, not wide"]);
    run("small.obj --accel bih --volumes aabb").refused(&["--volumes aabb requires --accel bvh2, not bih"]);
    run("small.obj --accel kdtree --builder sah").refused(&["--builder sah requires --accel wide or bvh2, not kdtree"]);
    run("small.obj --accel bih --aligned").refused(&["--aligned requires --accel wide, not bih"]);
    let asset = "[[assets]]\nname = 'a'\nfile = 'small.obj'\n[settings]\nspp = 1\n";
    let moves = "[[instances]]\nasset = 'a'\nclose = { translation = [1, 0, 0] }\n";
    folder.write("still.toml", asset);
    folder.write("moves.toml", format!("{asset}{moves}"));
    folder.write("binary.toml", format!("{asset}volumes = 'aabb'\npreset = 'quality'\n"));
    folder.write("rays.csv", "0,0,1,0,0,-1,9\n");
    let cast =
        folder.run("cast small.obj --rays rays.csv --hits hits.csv --device cpu --volumes aabb --preset fast").done();
    assert!(
        cast.n_warnings() == 1 && cast.stderr.contains("--preset has no effect on the binary BVH of --volumes aabb"),
        "{}",
        cast.stderr
    );
    for (options, words) in [
        ("small.obj --heatmap boxes", ""),
        ("small.obj --heatmap boxes --eye 0,0,9 --fov 30", ""),
        ("small.obj --heatmap boxes --aperture 0.1", "--heatmap ignores --aperture"),
        ("small.obj --heatmap boxes --aperture 0.1 --focus 3", "--heatmap ignores --aperture, --focus"),
        ("small.obj --preset fast --spp 1", ""),
        ("small.obj --volumes dop --spp 1", ""),
        ("small.obj --volumes auto --preset quality --spp 1", ""),
        (
            "small.obj --volumes dop --preset quality --spp 1",
            "--preset has no effect on the binary BVH of --volumes dop",
        ),
        ("small.obj --accel bvh2 --spp 1", ""),
        ("small.obj --accel bih --preset quality --spp 1", "--preset has no effect on --accel bih"),
        ("binary.toml --accel kdtree", ""),
        ("binary.toml --accel wide", ""),
        ("small.obj --heatmap boxes --spp 2 --lod none --env 1,1,1", "--heatmap ignores --spp, --lod, --env"),
        ("still.toml --heatmap boxes", ""),
        ("still.toml --levels one", ""),
        ("binary.toml", ""),
        ("binary.toml --volumes auto --preset fast", ""),
        ("binary.toml --preset fast", "binary BVH of --volumes aabb"),
        ("moves.toml --levels auto", ""),
        ("moves.toml --levels one", "moving instances require two levels"),
    ] {
        let run = run(&format!("{options} --device cpu")).done();
        assert_eq!(run.n_warnings(), usize::from(!words.is_empty()), "{options}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{options}: {}", run.stderr);
    }
}

#[test]
fn unsupported_formats_are_rejected() {
    let folder = Folder::with_small();
    folder.write("rays.csv", "0,0,1,0,0,-1,9\n");
    folder
        .run("render small.obj -o out.gif --size 8x8")
        .refused(&["out.gif: unsupported format '.gif'; use .png, .jpg, .webp, .hdr or .exr", "ffmpeg"]);
    folder
        .run("render small.obj -o out.mp4 --size 8x8")
        .refused(&["--frames 0..48 -o frame_%04d.png", "ffmpeg -framerate 24 -i frame_%04d.png out.mp4"]);
    folder.run("render small.obj -o out.tif --size 8x8").refused(&["'.tif'", "magick canted.png out.tif"]);
    folder
        .run("render small.obj -o out --size 8x8")
        .refused(&["out: unsupported format; use .png, .jpg, .webp, .hdr or .exr"]);
    folder.run("cast small.obj --rays rays.csv --hits hits.txt").refused(&["hits.txt", ".csv", ".bin"]);
    folder.run("cast small.obj --rays small.obj --hits hits.csv").refused(&["small.obj", ".csv", ".bin"]);
    assert_eq!(folder.names(), ["rays.csv", "small.obj"]);
}

// Output files are written completely or not at all.

const RAYS: &str = "0.5,0.5,5,0,0,-1,9\n";

/// Commands that write a file; `OUT` stands for its name.
const WRITERS: [&str; 4] = [
    "render small.obj --size 8x8 --spp 1 -o OUT.png",
    "cast small.obj --rays rays.csv --hits OUT.csv",
    "tree small.obj --codes OUT.csv --nodes nodes.csv",
    "tree small.obj --codes codes.csv --nodes OUT.csv",
];

fn with_rays() -> Folder {
    let folder = Folder::with_small();
    folder.write("rays.csv", RAYS);
    folder
}

#[test]
fn a_missing_folder_is_reported() {
    for line in WRITERS {
        let folder = with_rays();
        folder.run(&line.replace("OUT", "missing/out")).refused(&["cannot write missing/out", "no such"]);
        assert_eq!(folder.names(), ["rays.csv", "small.obj"], "{line}");
    }
}

#[test]
fn a_folder_is_rejected_as_output() {
    for line in WRITERS {
        let folder = with_rays();
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
    let folder = with_rays();
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
    let folder = with_rays();
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
    let folder = with_rays();
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
    let folder = with_rays();
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
    let folder = with_rays();
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
    let folder = with_rays();
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
    let folder = with_rays();
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

// Input files that are missing, empty, malformed, or state false counts.

#[test]
fn missing_and_empty_files_are_reported_by_name() {
    let folder = Folder::with_small();
    for name in ["empty.obj", "empty.ply", "empty.gltf", "empty.glb", "empty"] {
        folder.write(name, "");
    }
    for name in ["missing.obj", "missing.ply", "empty.obj", "empty.ply", "empty.gltf", "empty.glb", "empty", "."] {
        folder.run(&format!("stats {name}")).refused(&[name]);
        folder.run(&format!("render {name} -o out.png")).refused(&[name]);
        folder.run(&format!("tree {name} --codes codes.csv --nodes nodes.csv")).refused(&[name]);
        folder.run(&format!("compare {name} {name}")).refused(&[name]);
    }
    folder.run("cast small.obj --rays missing.csv --hits hits.csv").refused(&["missing.csv"]);
    assert!(!folder.names().iter().any(|name| name.starts_with("out") || name.ends_with(".csv")));
}

#[test]
fn false_counts_are_rejected_quickly() {
    let folder = Folder::new();
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n\
                  property float z\nelement face 4000000000\nproperty list uchar int vertex_indices\nend_header\n";
    folder.write("huge.ply", header);
    folder.write("huge.glb", [b"glTF\x02\0\0\0".as_slice(), &[255; 8], b"JSON{}"].concat());
    folder.write("huge.png", b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\x7f\xff\xff\xff\x7f\xff\xff\xff\x08\x02\0\0\0");
    let start = std::time::Instant::now();
    folder.run("stats huge.ply").refused(&["huge.ply"]);
    folder.run("stats huge.glb").refused(&["huge.glb"]);
    folder.run("compare huge.png huge.png").refused(&["huge.png"]);
    assert!(start.elapsed().as_secs() < 10, "three files took {:?}", start.elapsed());
}

#[test]
fn warnings_go_to_standard_error_and_results_to_standard_output() {
    let folder = Folder::new();
    folder.write("nan.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n");
    let run = folder.run("stats nan.obj --json").done();
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
    assert_eq!(run.json()["placed_triangles"], 1);
    assert!(!run.stdout.contains("warning"));
}

/// Lines and points of an OBJ file are noted, once, and the report refers to it.
#[test]
fn elements_that_are_not_drawn_are_noted() {
    let folder = Folder::new();
    folder.write("lines.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\nl 2 3\np 1\n");
    let run = folder.run("render lines.obj -o out.png --size 8x8 --spp 1").done();
    let notes: Vec<&str> = run.stderr.lines().filter(|line| line.contains("not faces")).collect();
    assert_eq!(notes, ["note: skipping elements that are not faces: 2 lines, 1 point"], "{}", run.stderr);
    assert_eq!(run.n_warnings(), 0, "{}", run.stderr);
    assert!(run.stdout.contains("ignored   see the note above"), "{}", run.stdout);
    assert_eq!(folder.run("render lines.obj -o out.png --size 8x8 --spp 1 -q").done().stderr, "");
}

/// No camera position is representable outside such a scene, so it is seen from its edge.
#[test]
fn coordinates_near_the_largest_float_are_rendered() {
    let folder = Folder::new();
    folder.write("huge.obj", "v -3e38 0 0\nv 3e38 0 0\nv 0 3e38 -3e38\nf 1 2 3\n");
    let run = folder.run("render huge.obj -o out.png --size 8x8 --spp 1").done();
    assert_eq!(run.n_warnings(), 1, "{}", run.stderr);
}

/// A row of the table of malformed files.
struct Row {
    path: PathBuf,
    expected: String,
    code: i32,
}

/// Rows of `EXPECT.tsv` that are program inputs: models of the three formats, the OBJ file that refers to every image, and
/// environments.
fn table(folder: &Path) -> Vec<Row> {
    let table = fs::read_to_string(folder.join("EXPECT.tsv")).unwrap();
    let rows = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|line| line.split('\t').collect::<Vec<_>>())
        .filter(|row| !row[0].starts_with("img/") || row[0].ends_with(".obj") || is_environment(Path::new(row[0])))
        .map(|mut row| {
            // Superseded: sound geometry is drawn without the attributes that are not, and a file that requires Draco loads.
            match row[0] {
                "obj/vt_index_out_of_range.obj" => (row[2], row[3]) = ("warn", "0"),
                "gltf/draco_required.glb" => (row[2], row[3]) = ("load", "0"),
                _ => {}
            }
            row
        })
        .map(|row| Row { path: folder.join(row[0]), expected: row[2].to_owned(), code: row[3].parse().unwrap() })
        .collect()
}

fn is_environment(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "hdr" || ending == "exr")
}

#[test]
fn malformed_files_give_the_results_of_their_table() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let models = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    let nasty = models.join("nasty");
    if !nasty.is_dir() {
        let reason = format_args!("there is no folder {}", nasty.display());
        skip::<()>("malformed_files_give_the_results_of_their_table", reason);
        return;
    }
    let folder = Folder::with_small();
    folder.write("rays.csv", "0,0,100,0,0,-1,inf\n");
    let rows = table(&nasty);
    assert!(rows.len() > 100, "the table has only {} rows", rows.len());
    let mut wrong = vec![];
    for Row { path, expected, code } in rows {
        let line = if is_environment(&path) {
            "render small.obj --size 8x8 --spp 1 -o env.png --env"
        } else {
            "cast --rays rays.csv --hits hits.csv"
        };
        let output = folder
            .command(line)
            .arg(&path)
            .output()
            .map(|output| (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned()));
        let (got, stderr) = output.unwrap();
        let n_warnings = stderr.lines().filter(|line| line.starts_with("warning: ")).count();
        let is_named = stderr.contains(path.file_name().unwrap().to_str().unwrap());
        let is_right = match expected.as_str() {
            "load" => n_warnings == 0,
            "warn" => n_warnings > 0,
            "error" => stderr.matches("error: ").count() == 1 && is_named,
            other => panic!("{}: no such expectation: {other}", path.display()),
        };
        if got != Some(code) || !is_right {
            wrong.push(format!("{}: {expected} with {code}, but {got:?}: {stderr}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

// `canted devices`: the CPU and all adapters.

#[test]
fn lists_the_cpu_and_describes_every_adapter() {
    let folder = Folder::new();
    let json = folder.run("devices --json").done().json();
    assert!(json["cpu"]["threads"].as_u64().unwrap() > 0);
    for adapter in json["adapters"].as_array().unwrap() {
        assert!(!adapter["name"].as_str().unwrap().is_empty());
        assert_eq!(adapter["is_software"].as_bool().unwrap(), adapter["kind"] == "software");
    }
    let text = folder.run("devices").done().stdout;
    let n_with =
        json["adapters"].as_array().unwrap().iter().filter(|adapter| adapter["has_ray_queries"].as_bool().unwrap());
    assert_eq!(text.matches(", ray queries").count(), n_with.count(), "{text}");
    assert!(text.starts_with("cpu ") && text.contains("--device auto selects "), "{text}");
}
