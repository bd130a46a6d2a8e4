//! Exit codes and messages for invalid arguments.

use crate::support::{BUILDERS, Folder};

#[test]
fn help_and_version_go_to_standard_output() {
    let folder = Folder::new();
    let version = folder.run("--version").done();
    assert_eq!(version.stdout, format!("canted {}\n", env!("CARGO_PKG_VERSION")));
    let help = folder.run("--help").done();
    for command in ["render", "stats", "cast", "tree", "compare"] {
        assert!(help.stdout.contains(command), "{}", help.stdout);
        assert!(!folder.run(&format!("{command} --help")).done().stdout.is_empty());
    }
    assert_eq!(folder.names(), [""; 0]);
}

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
        .refused(&["out.gif: unsupported format '.gif'; use .png, .jpg, .webp, .hdr or .exr"]);
    folder
        .run("render small.obj -o out --size 8x8")
        .refused(&["out: unsupported format; use .png, .jpg, .webp, .hdr or .exr"]);
    folder.run("cast small.obj --rays rays.csv --hits hits.txt").refused(&["hits.txt", ".csv", ".bin"]);
    folder.run("cast small.obj --rays small.obj --hits hits.csv").refused(&["small.obj", ".csv", ".bin"]);
    assert_eq!(folder.names(), ["rays.csv", "small.obj"]);
}
