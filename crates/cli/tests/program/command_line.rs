//! `canted FILE`, `-q`, `-v`, streams, completions and manual pages.

use std::{
    io::Write,
    process::{Output, Stdio},
};

use crate::support::Folder;

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
    let help = folder.run("--help").done().stdout;
    let line = help.lines().find(|line| line.starts_with("Features of this build: ")).unwrap();
    assert_eq!(line.contains("gpu"), cfg!(feature = "gpu"), "{line}");
    for command in ["render", "scene", "stats", "cast", "tree", "compare", "devices", "merge"] {
        let help = folder.run(&format!("{command} --help")).done().stdout;
        let examples = help.split("Examples:").nth(1).unwrap_or_else(|| panic!("{command}: {help}"));
        assert!(examples.matches(&format!("canted {command} ")).count() >= 2 || command == "devices", "{examples}");
    }
    let help = folder.run("render --help").done().stdout;
    for heading in ["Scene:", "Picture:", "Run:", "Frames:", "Rendering:", "Look", "Camera:", "Light", "Messages:"] {
        assert!(help.contains(heading), "{heading}");
    }
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
