//! `--samples`, `--noise` and `--checkpoint`: samples of a picture taken in parts, adaptively, and in several runs.

use serde_json::Value;

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

// `canted render --noise`: pixels stop at the requested error, and the reported error is true.

const NOISY: &str = "render small.obj --size 40x24 --bounces 2 --env 0.6,0.6,0.6";

fn number(facts: &Value, key: &str) -> f64 {
    facts[key].as_f64().unwrap_or_else(|| panic!("{key}: {facts}"))
}

#[test]
fn less_noise_takes_more_samples() {
    let folder = Folder::with_small();
    let mut before = 0.0;
    for noise in [0.02, 0.006, 0.003] {
        let facts = folder.run(&format!("{NOISY} --spp 4096 --noise {noise} --json -o a.exr")).done().json();
        let (reached, spent) = (number(&facts, "noise_reached"), number(&facts, "mean_samples_per_pixel"));
        assert!(0.0 < reached && reached <= noise, "{facts}");
        assert!(before < spent && spent < 4096.0, "{before} {facts}");
        before = spent;
    }
    let text = folder.run(&format!("{NOISY} --spp 64 --noise 0.1 -v -o a.exr")).done().stdout;
    assert!(text.contains("noise reached") && text.contains("mean samples per pixel"), "{text}");
}

#[test]
fn spp_is_the_maximum() {
    let folder = Folder::with_small();
    let one = folder.run(&format!("{NOISY} --spp 1 --noise 0.1 -v -o a.exr")).done().stdout;
    assert!(one.lines().any(|line| line.starts_with("noise reached") && line.ends_with("unknown")), "{one}");
    let facts = folder.run(&format!("{NOISY} --spp 24 --noise 1e-6 --json -o a.exr")).done().json();
    assert!(number(&facts, "noise_reached") > 1e-6, "{facts}");
    // Cells that show only sky have no noise and stop at 16 samples.
    let spent = number(&facts, "mean_samples_per_pixel");
    assert!((16.0..=24.0).contains(&spent), "{facts}");
    folder.run(&format!("{NOISY} --spp 24 --sampler sobol -o b.exr")).done();
    folder.run("compare a.exr b.exr --max 1e-3").done();
}

#[test]
fn threads_do_not_change_a_byte() {
    let folder = Folder::with_small();
    let picture = |n: u32| {
        folder.run(&format!("{NOISY} --spp 256 --noise 0.005 --aovs all --threads {n} -o a.exr")).done();
        folder.bytes("a.exr")
    };
    let one = picture(1);
    assert!((2..=3).all(|n| picture(n) == one));
}

/// The estimate is for independent samples. The error of the reference is much smaller.
#[test]
fn the_reported_error_is_true() {
    let folder = Folder::with_small();
    folder.run(&format!("{NOISY} --spp 16384 --seed 1 --sampler sobol -o long.exr")).done();
    for noise in [0.02, 0.004] {
        let line = format!("{NOISY} --spp 8192 --noise {noise} --sampler random --json -o a.exr");
        let reported = number(&folder.run(&line).done().json(), "noise_reached");
        let found = folder.run("compare a.exr long.exr --json").done().json();
        // In a gray picture, the relative error of each channel equals that of luminance.
        let ratio = number(&found, "relmse").sqrt() / reported;
        assert!((0.85..1.15).contains(&ratio), "{noise}: {reported} reported, {ratio} times that measured");
    }
}

// `canted render --checkpoint`: an interrupted render continues to the same bytes.

/// Many small tiles.
const CHECKPOINTED: &str =
    "render small.obj --size 160x128 --spp 8 --threads 2 --aovs all --checkpoint work.ckpt -o out.exr";

/// The bytes of the picture rendered without a checkpoint.
fn uninterrupted(folder: &Folder, line: &str) -> Vec<u8> {
    folder.run(&line.replace("--checkpoint work.ckpt", "").replace("--checkpoint-every 0", "")).done();
    let bytes = folder.bytes("out.exr");
    std::fs::remove_file(folder.path("out.exr")).unwrap();
    bytes
}

#[test]
fn a_complete_render_removes_its_checkpoint() {
    let folder = Folder::with_small();
    let expected = uninterrupted(&folder, CHECKPOINTED);
    folder.run(&format!("{CHECKPOINTED} --checkpoint-every 0")).done();
    assert!(folder.bytes("out.exr") == expected);
    assert_eq!(folder.names(), ["out.exr", "small.obj"]);
}

#[test]
fn other_files_are_rejected_as_checkpoints_and_kept() {
    let folder = Folder::with_small();
    folder.write("work.ckpt", "precious");
    folder.run(CHECKPOINTED).refused(&["work.ckpt", "checkpoint"]);
    assert_eq!(folder.text("work.ckpt"), "precious");
    folder.run(&CHECKPOINTED.replace("work.ckpt", "no/work.ckpt")).refused(&["no/work.ckpt"]);
    assert_eq!(folder.names(), ["small.obj", "work.ckpt"]);
}

#[cfg(unix)]
mod stopped {
    use std::{
        process::{Child, Command, Stdio},
        thread::sleep,
        time::Duration,
    };

    use super::{CHECKPOINTED, uninterrupted};
    use crate::{
        process::{catches, is_ignored, send, wait_until},
        support::Folder,
    };

    /// A render that takes a few seconds.
    fn slow(options: &str) -> String {
        CHECKPOINTED.replace("--spp 8", options)
    }

    /// Starts a render and waits until it has written a checkpoint.
    fn start(folder: &Folder, line: &str) -> Child {
        let mut command = folder.command(&format!("{line} --checkpoint-every 0"));
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_until(|| folder.path("work.ckpt").exists() || child.try_wait().unwrap().is_some());
        assert!(child.try_wait().unwrap().is_none(), "the render ended too early");
        child
    }

    /// Writes once a day, so that only a signal writes.
    fn rarely(line: &str) -> String {
        format!("{line} --checkpoint-every 86400")
    }

    /// Stops a render by a signal, which must write the finished tiles. Retries later, because at first no tile may be finished.
    fn stop(folder: &Folder, signal: &str, start: impl Fn() -> Child) {
        let read = || std::fs::read(folder.path("work.ckpt")).ok();
        let before = read();
        let is_written = (0..8).any(|doubled| {
            let mut child = start();
            sleep(Duration::from_millis(50 << doubled));
            assert_eq!(send(signal, &mut child), Some(130), "{signal}");
            read() != before
        });
        assert!(is_written, "{signal}");
        assert_eq!(folder.names(), ["small.obj", "work.ckpt"], "{signal}");
    }

    #[test]
    fn a_killed_render_continues_to_the_same_bytes() {
        let folder = Folder::with_small();
        for options in ["--spp 128", "--samples 5..120", "--spp 256 --noise 0.002"] {
            let line = slow(options);
            let expected = uninterrupted(&folder, &line);
            // Twice, so that a continued render is killed too.
            for _ in 0..2 {
                let mut child = start(&folder, &line);
                child.kill().unwrap();
                child.wait().unwrap();
            }
            assert!(!folder.names().contains(&"out.exr".to_owned()));
            folder.run(&line.replace("--threads 2", "--threads 1")).done();
            assert!(folder.bytes("out.exr") == expected, "{options}");
            // A killed process leaves its temporary files behind.
            let mut rest = folder.names();
            rest.retain(|name| !name.ends_with(".tmp"));
            assert_eq!(rest, ["out.exr", "small.obj"], "{options}");
            std::fs::remove_file(folder.path("out.exr")).unwrap();
        }
    }

    /// The output folder is removed while rendering.
    #[test]
    fn a_picture_that_cannot_be_written_keeps_its_checkpoint() {
        let folder = Folder::with_small();
        let line = slow("--spp 512").replace("out.exr", "sub/out.exr");
        // Retries later: if the folder is removed too early, the output is rejected before rendering.
        let is_kept = (0..8).any(|doubled| {
            std::fs::create_dir(folder.path("sub")).unwrap();
            let mut command = folder.command(&rarely(&line));
            let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
            sleep(Duration::from_millis(50 << doubled));
            std::fs::remove_dir_all(folder.path("sub")).unwrap();
            assert_eq!(child.wait().unwrap().code(), Some(2));
            folder.path("work.ckpt").exists()
        });
        assert!(is_kept);
        assert_eq!(folder.names(), ["small.obj", "work.ckpt"]);
        std::fs::create_dir(folder.path("sub")).unwrap();
        folder.run(&line).done();
        assert_eq!(folder.names(), ["small.obj", "sub"]);
    }

    #[test]
    fn ctrl_c_writes_the_checkpoint_and_ends_with_130() {
        if is_ignored("ctrl_c_writes_the_checkpoint_and_ends_with_130") {
            return;
        }
        let folder = Folder::with_small();
        let line = slow("--spp 256");
        let expected = uninterrupted(&folder, &line);
        // Ctrl-C, and the signal of schedulers.
        for signal in ["-INT", "-TERM"] {
            stop(&folder, signal, || {
                let child = folder.command(&rarely(&line)).stdout(Stdio::null()).spawn().unwrap();
                wait_until(|| catches("INT", &child).unwrap_or(true));
                child
            });
        }
        folder.run(&line).done();
        assert!(folder.bytes("out.exr") == expected);
        assert_eq!(folder.names(), ["out.exr", "small.obj"]);
    }

    /// As started by the `&` of a script, or by `nohup`.
    #[cfg(target_os = "linux")]
    #[test]
    fn ignored_signals_stay_ignored_and_others_are_handled() {
        let folder = Folder::with_small();
        let program = folder.command(&rarely(&slow("--spp 256")));
        stop(&folder, "-TERM", || {
            let mut command = Command::new("sh");
            command
                .args(["-c", "trap '' INT HUP; exec \"$@\"", "sh"])
                .arg(program.get_program())
                .args(program.get_args());
            let child = command.current_dir(folder.path("")).stdout(Stdio::null()).spawn().unwrap();
            wait_until(|| catches("TERM", &child).unwrap_or(true));
            assert_eq!(["INT", "HUP"].map(|signal| catches(signal, &child)), [Some(false); 2]);
            child
        });
    }

    #[test]
    fn checkpoints_of_other_pictures_and_damaged_ones_are_rejected() {
        let folder = Folder::with_small();
        let line = slow("--spp 128");
        let mut child = start(&folder, &line);
        child.kill().unwrap();
        child.wait().unwrap();
        let bytes = folder.bytes("work.ckpt");
        for (from, to, words) in [
            ("--spp 128", "--spp 64", "128"),
            ("--spp 128", "--samples 0..128", "sampler"),
            ("--spp 128", "--spp 128 --seed 4", "seed is 0, not 4"),
            ("--spp 128", "--spp 128 --noise 0.1 --sampler stratified", "noise is none, not 0.1"),
            ("--aovs all", "--aovs depth", "aovs is"),
            ("160x128", "128x160", "size is 160x128, not 128x160"),
            ("--spp 128", "--spp 128 --env 1,1,1", "light is"),
        ] {
            folder.run(&line.replace(from, to)).refused(&["work.ckpt", words]);
        }
        let mut damaged = bytes.clone();
        let last = damaged.len() - 100;
        damaged[last] ^= 1;
        for content in [&damaged[..], &bytes[..bytes.len() - 8], &bytes[..30], b""] {
            folder.write("work.ckpt", content);
            folder.run(&line).refused(&["work.ckpt"]);
        }
        assert!(!folder.names().contains(&"out.exr".to_owned()));
    }
}
