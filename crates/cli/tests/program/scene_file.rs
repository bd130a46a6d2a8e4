//! Scene files: writing, rendering, and errors.

use crate::{render::animated, support::Folder};

/// Asserts that a scene and its scene file give the same picture.
#[track_caller]
fn assert_same_bits(scene: &str, options: &str) {
    let folder = Folder::with_small();
    folder.run(&format!("scene {scene} --size 24x16 --spp 2 {options} -o s.toml")).done();
    folder.run(&format!("render {scene} --size 24x16 --spp 2 {options} -o a.exr")).done();
    folder.run("render s.toml -o b.exr").done();
    assert_eq!(folder.bytes("a.exr"), folder.bytes("b.exr"), "{scene} {options}: {}", folder.text("s.toml"));
    // A complete file is written again without change.
    folder.run("scene s.toml -o t.toml").done();
    assert_eq!(folder.text("s.toml"), folder.text("t.toml"), "{scene} {options}");
}

#[test]
fn a_scene_and_its_file_give_the_same_picture() {
    assert_same_bits("", "--preset fast");
    assert_same_bits("small.obj", "");
    assert_same_bits(
        "small.obj",
        "--eye 2,3,4 --target 0,0,0 --fov 30 --aperture 0.1 --focus 4 --seed 7 --filter tent",
    );
    assert_same_bits("small.obj", "--sun -1,-1,-1,1,2,3 --point 0.1,2,0,1,1,1 --ao-radius inf --bounces 0");
    assert_same_bits("small.obj", "--integrator path --sphere 0.5,3,-1,0.25,9,8,7");
    assert_same_bits("small.obj", "--integrator path --env 0.1,0.2,0.3 --sampler sobol --noise 0.5");
}

/// Environment maps and animation times of options are in the file.
#[test]
fn files_and_times_of_options_are_in_the_file() {
    const CAMERA: &str = "--eye 3,1,12 --target 3,0,0 --size 24x16 --spp 2";
    let folder = animated();
    folder.run(&format!("render animated.gltf {CAMERA} -o sky.exr")).done();
    for options in ["--env sky.exr --env-turn 40 --env-scale 2", "--time 1"] {
        folder.run(&format!("scene animated.gltf {CAMERA} {options} -o s.toml")).done();
        folder.run(&format!("render animated.gltf {CAMERA} {options} -o a.exr")).done();
        folder.run("render s.toml -o b.exr").done();
        assert!(folder.bytes("a.exr") != folder.bytes("sky.exr"), "{options} changes nothing");
        assert!(folder.bytes("a.exr") == folder.bytes("b.exr"), "{options}: {}", folder.text("s.toml"));
    }
    folder.run("scene s.toml --time 1 -o t.toml").refused(&["s.toml", "--time"]);
}

/// Without -o, only scene files that the program wrote are replaced.
#[test]
fn scene_files_of_others_are_not_replaced() {
    let folder = Folder::with_small();
    let others = "[[assets]]\nname = \"a\"\nfile = \"small.obj\"\n";
    folder.write("scene.toml", others);
    folder.run("scene small.obj").refused(&["scene.toml", "not a scene file that canted wrote", "-o", "--force"]);
    assert_eq!(folder.text("scene.toml"), others);
    for line in ["scene small.obj --force", "scene small.obj --spp 3"] {
        folder.run(line).done();
    }
    let own = folder.text("scene.toml");
    assert!(own.contains("spp = 3"), "{own}");
    folder.write("scene.toml", others);
    folder.run("scene small.obj --spp 3 -o scene.toml").done();
    assert_eq!(folder.text("scene.toml"), own);
}

#[test]
fn the_command_line_overrides_the_file() {
    let folder = Folder::with_small();
    folder.run("scene small.obj --size 24x16 --spp 2 --seed 3 -o s.toml").done();
    folder.run("render s.toml --seed 4 --size 24x16 -o a.exr").done();
    folder.run("render small.obj --size 24x16 --spp 2 --seed 4 -o b.exr").done();
    assert_eq!(folder.bytes("a.exr"), folder.bytes("b.exr"));
    folder.run("render s.toml -o c.exr").done();
    assert_ne!(folder.bytes("a.exr"), folder.bytes("c.exr"));
    // Parts of the samples that the file states.
    folder.run("render s.toml --samples 0..1 -o 0.exr").done();
    folder.run("render s.toml --samples 1..2 -o 1.exr").done();
    folder.run("merge 0.exr 1.exr -o whole.exr").done();
    folder.run("render s.toml --sampler sobol --samples 0..3 -o sobol.exr").done();
}

/// Settings for one kind of picture do not prevent another.
#[test]
fn settings_that_contradict_options_are_ignored() {
    let folder = Folder::with_small();
    folder.run("scene small.obj --size 24x16 --spp 2 --bounces 8 --noise 0.5 --ao-radius 1 -o s.toml").done();
    folder.run("render s.toml --heatmap boxes -o heat.png").done();
    folder.run("render s.toml --integrator path --noise 0.5 -o a.exr").done();
    folder.run("render small.obj --size 24x16 --spp 2 --bounces 8 --noise 0.5 --integrator path -o b.exr").done();
    assert_eq!(folder.bytes("a.exr"), folder.bytes("b.exr"));
    folder.run("scene s.toml --integrator path -o t.toml").done();
    folder.run("render t.toml -o c.exr").done();
    assert_eq!(folder.bytes("a.exr"), folder.bytes("c.exr"));
    folder.run("render s.toml --integrator path --ao-radius 2 -o d.exr").refused(&["--ao-radius"]);
}

#[test]
fn every_command_reads_scene_files() {
    let folder = Folder::with_small();
    folder.write("s.toml", "[[assets]]\nname = 'small'\nfile = 'small.obj'\n");
    folder.run("stats s.toml").done();
    folder.run("tree s.toml --codes c.csv --nodes n.csv").done();
    folder.run("tree small.obj --codes c2.csv --nodes n2.csv").done();
    assert_eq!(folder.text("c.csv"), folder.text("c2.csv"));
}

#[test]
fn errors_are_reported_with_their_line_and_nothing_is_written() {
    let folder = Folder::with_small();
    let asset = "[[assets]]\nname = 'small'\nfile = 'small.obj'\n";
    let cases: &[(&str, &[&str])] = &[
        ("[settings]\nssp = 3", &["line 5", "'ssp'", "'spp'"]),
        ("[settings]\nspp = 0", &["line 5", "'spp'", "\"0\""]),
        ("[settings]\nspp = 4.0", &["line 5", "'spp'", "4.0", "whole number"]),
        ("[settings]\nspp = 'many'", &["line 5", "'spp'", "many"]),
        ("[settings]\nfilter = 'bocks'", &["line 5", "'filter'", "bocks", "box"]),
        ("[settings]\nao_radius = -1", &["line 5", "'ao_radius'", "-1"]),
        ("[settings]\nsize = '0x3'", &["line 5", "'size'", "0x3"]),
        ("[settings]\nfov = 30", &["line 5", "'fov'", "[camera]"]),
        ("[settings]\nthreads = 1", &["line 5", "'threads'"]),
        ("[camera]\neye = [0, 0, nan]\ntarget = [0, 0, 0]", &["line 5", "'eye'", "nan"]),
        ("[light]\n", &["line 4", "'light'", "'lights'"]),
    ];
    for (text, words) in cases {
        folder.write("s.toml", format!("{asset}{text}"));
        for command in ["render s.toml -o a.png", "scene s.toml -o t.toml", "stats s.toml"] {
            folder.run(command).refused(words);
        }
    }
    folder.run("scene small.obj -o s.obj").refused(&["s.obj: unsupported format '.obj'; use .toml"]);
    folder.run("scene small.obj --threads 1 -o t.toml").refused(&["--threads"]);
    folder.run("scene absent.obj -o t.toml").refused(&["absent.obj"]);
    assert_eq!(folder.names(), ["s.toml", "small.obj"], "nothing is written");
}
