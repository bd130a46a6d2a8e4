//! `canted render --samples` and `canted merge`: parts merge to the same bytes as one render, or are rejected.

use crate::support::Folder;

const RENDER: &str = "render small.obj --size 21x13 --bounces 1 --env 0.5,0.7,1 --sun 0,-1,-1,2,2,2";

/// Renders samples `range` into a file named after it.
fn part(folder: &Folder, range: &str, options: &str) -> String {
    let name = format!("{}.exr", range.replace("..", "-"));
    folder.run(&format!("{RENDER} --samples {range} {options} -o {name}")).done();
    name
}

#[test]
fn parts_in_any_order_merge_to_the_bytes_of_one_render() {
    let folder = Folder::with_small();
    for options in ["", "--aovs all --seed 7", "--sampler random --aovs depth", "--sampler stratified --spp 32"] {
        let expected = folder.bytes(&part(&folder, "0..32", options));
        let [half, other_half, start, end, middle] =
            ["0..16", "16..32", "0..5", "5..32", "5..19"].map(|range| part(&folder, range, options));
        let last = part(&folder, "19..32", options);
        for parts in [
            format!("{half} {other_half}"),
            format!("{end} {start}"),
            format!("{last} {start} {middle}"),
            format!("{middle} {last} {start}"),
        ] {
            folder.run(&format!("merge {parts} -o merged.exr")).done();
            assert!(folder.bytes("merged.exr") == expected, "{options}: {parts}");
        }
        // A merged file is a part.
        folder.run(&format!("merge {last} {middle} -o rest.exr")).done();
        assert!(folder.bytes("rest.exr") == folder.bytes(&end), "{options}");
        folder.run(&format!("merge {start} rest.exr -o merged.exr")).done();
        assert!(folder.bytes("merged.exr") == expected, "{options}");
    }
}

#[test]
fn threads_do_not_change_a_byte_of_a_part() {
    let folder = Folder::with_small();
    let first = folder.bytes(&part(&folder, "3..9", "--aovs all --threads 1"));
    for n in 2..=3 {
        assert!(folder.bytes(&part(&folder, "3..9", &format!("--aovs all --threads {n}"))) == first, "{n}");
    }
}

#[test]
fn a_part_is_a_picture() {
    let folder = Folder::with_small();
    let name = part(&folder, "16..48", "");
    folder.run(&format!("{RENDER} --samples 0..64 --sampler sobol -o whole.exr")).done();
    folder.run(&format!("{RENDER} --spp 64 --sampler sobol -o plain.exr")).done();
    folder.run("compare whole.exr plain.exr --max 0").done();
    let found = folder.run(&format!("compare {name} plain.exr --json")).done().json();
    assert!((0.9..1.1).contains(&found["mean_ratio"].as_f64().unwrap()), "{found}");
    assert!(found["rmse"].as_f64().unwrap() > 0.0, "other samples have other noise");
}

#[test]
fn the_report_states_the_samples() {
    let folder = Folder::with_small();
    let facts = folder.run(&format!("{RENDER} --samples 4..7 --json -o a.exr")).done().json();
    assert_eq!((&facts["samples"], &facts["samples_per_pixel"]), (&"4..7".into(), &3.into()));
    part(&folder, "7..9", "");
    let facts = folder.run("merge 7-9.exr a.exr -o b.exr --json").done().json();
    assert_eq!((&facts["samples"], &facts["parts"]), (&"4..9".into(), &2.into()));
    assert!(folder.run("merge 7-9.exr a.exr -o b.exr").done().stdout.contains("4..9"));
}

#[test]
fn gaps_and_overlaps_are_rejected_with_files_and_ranges() {
    let folder = Folder::with_small();
    let [a, b, c] = ["0..8", "4..12", "20..24"].map(|range| part(&folder, range, ""));
    folder.run(&format!("merge {a} {b} -o out.exr")).refused(&[&a, &b, "0..8", "4..12", "overlap"]);
    folder.run(&format!("merge {a} {a} -o out.exr")).refused(&[&a, "0..8", "overlap"]);
    folder.run(&format!("merge {c} {a} -o out.exr")).refused(&[&a, &c, "8..20", "missing"]);
    assert!(!folder.names().contains(&"out.exr".to_owned()));
}

#[test]
fn parts_of_different_pictures_are_rejected_with_the_difference() {
    let folder = Folder::with_small();
    let a = part(&folder, "0..4", "");
    folder.write("other.obj", crate::support::SMALL.replace("v 1 1 0", "v 1 1.5 0"));
    let render = |options: &str| {
        folder.run(&format!("{options} --samples 4..8 -o b.exr")).done();
        folder.run(&format!("merge {a} b.exr -o out.exr"))
    };
    let changed = |from: &str, to: &str| render(&RENDER.replace(from, to));
    changed("--bounces 1", "--bounces 3").refused(&[&a, "b.exr", "bounces is 1 and 3"]);
    changed("21x13", "13x21").refused(&["21 x 13", "13 x 21"]);
    changed("small.obj", "other.obj --eye 5,5,5 --target 0,0,0").refused(&["scene is"]);
    changed("0.5,0.7,1", "0.5,0.7,2").refused(&["light is"]);
    for (option, words) in [
        ("--seed 3", "seed is 0 and 3"),
        ("--sampler random", "sampler is sobol and random"),
        ("--sampler stratified --spp 8", "sampler is sobol and stratified of 8"),
        ("--filter blackman-harris", "filter is box and blackman-harris"),
        ("--ao-radius 2", "ao-radius is auto and 2"),
        ("--eye 3,3,3 --target 0,0,0", " and 3,3,3"),
        ("--fov 20.5", "fov is 40 and 20.5"),
        ("--aperture 0.5 --focus 3", "aperture is 0 and 0.5"),
        ("--triangles moller-trumbore", "triangles is watertight and moller-trumbore"),
        ("--aovs depth,albedo", "aovs is none and depth,albedo"),
    ] {
        render(&format!("{RENDER} {option}")).refused(&[&a, "b.exr", words]);
    }
    assert!(!folder.names().contains(&"out.exr".to_owned()));
}

#[test]
fn files_that_are_not_parts_are_rejected() {
    let folder = Folder::with_small();
    let name = part(&folder, "0..4", "--aovs normal");
    folder.run(&format!("{RENDER} --spp 4 -o plain.exr")).done();
    folder.run(&format!("merge {name} plain.exr -o out.exr")).refused(&["plain.exr", "--samples"]);
    folder.run(&format!("merge {name} absent.exr -o out.exr")).refused(&["absent.exr"]);
    folder.run(&format!("merge {name} small.obj -o out.exr")).refused(&["small.obj"]);
    folder.run(&format!("merge {name} -o out.png")).refused(&["out.png", ".exr"]);
    folder.run("merge -o out.exr").refused(&["<PART>"]);
    // Damaged files do not cause a panic.
    let bytes = folder.bytes(&name);
    folder.run(&format!("merge {name} -o whole.exr")).done();
    assert!(folder.bytes("whole.exr") == bytes);
    for at in (0..bytes.len()).step_by(bytes.len() / 40) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        folder.write("damaged.exr", &damaged);
        let run = folder.run("merge damaged.exr -o out.exr");
        if run.code == Some(2) {
            run.refused(&["damaged.exr"]);
        }
        folder.write("damaged.exr", &bytes[..at]);
        folder.run("merge damaged.exr -o out.exr").refused(&["damaged.exr"]);
    }
}

/// The size in a header is checked against the size of the file before memory is allocated.
#[test]
fn parts_with_false_sizes_are_rejected() {
    let folder = Folder::with_small();
    let name = part(&folder, "0..4", "");
    let mut bytes = folder.bytes(&name);
    let window = b"dataWindow\0box2i\0";
    let offsets: Vec<usize> = (0..bytes.len()).filter(|&at| bytes[at..].starts_with(window)).collect();
    for at in offsets {
        // The largest column and row follow the length and the smallest ones.
        let last = at + window.len() + 4 + 8;
        bytes[last..last + 8].copy_from_slice(&[8191_i32.to_le_bytes(); 2].concat());
    }
    folder.write("huge.exr", bytes);
    folder.run(&format!("merge huge.exr {name} -o out.exr")).refused(&["huge.exr", "invalid image size 8192 x 8192"]);
    folder.run(&format!("compare huge.exr {name}")).refused(&["huge.exr", "invalid image size 8192 x 8192"]);
}

#[test]
fn contradictory_options_are_rejected() {
    let folder = Folder::with_small();
    let cases: &[(&str, &[&str])] = &[
        ("--samples 0..4 -o a.png", &["--samples", ".exr"]),
        ("--aovs depth -o a.png", &["--aovs", ".exr"]),
        ("--samples 0..4 --spp 4 -o a.exr", &["--spp 4", "--samples 0..4"]),
        ("--samples 0..4 --sampler stratified -o a.exr", &["--sampler stratified", "--spp"]),
        ("--samples 0..9 --sampler stratified --spp 8 -o a.exr", &["0..9", "--spp 8"]),
        ("--samples 0..4 --noise 0.1 -o a.exr", &["--samples", "--noise"]),
        ("--samples 4..4 -o a.exr", &["--samples", "4..4"]),
        ("--samples 4 -o a.exr", &["--samples", "A..B"]),
        ("--samples 0..2000000 -o a.exr", &["--samples", "2000000"]),
        ("--aovs depth,smell -o a.exr", &["--aovs", "smell", "depth"]),
        ("--aovs depth --heatmap boxes -o a.exr", &["--aovs", "--heatmap"]),
        ("--noise 0 -o a.exr", &["--noise", "0"]),
        ("--noise nan -o a.exr", &["--noise", "nan"]),
        ("--noise 0.1 --heatmap boxes -o a.exr", &["--noise", "--heatmap"]),
        ("--checkpoint c --heatmap boxes -o a.exr", &["--checkpoint", "--heatmap"]),
        ("--checkpoint-every 5 -o a.exr", &["--checkpoint"]),
    ];
    for (options, words) in cases {
        folder.run(&format!("{RENDER} {options}")).refused(words);
    }
    assert_eq!(folder.names(), ["small.obj"]);
}
