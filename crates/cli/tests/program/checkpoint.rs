//! `canted render --checkpoint`: an interrupted render continues to the same bytes.

use crate::support::Folder;

/// Many small tiles.
const RENDER: &str = "render small.obj --size 160x128 --spp 8 --threads 2 --aovs all --checkpoint work.ckpt -o out.exr";

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
    let expected = uninterrupted(&folder, RENDER);
    folder.run(&format!("{RENDER} --checkpoint-every 0")).done();
    assert!(folder.bytes("out.exr") == expected);
    assert_eq!(folder.names(), ["out.exr", "small.obj"]);
}

#[test]
fn other_files_are_rejected_as_checkpoints_and_kept() {
    let folder = Folder::with_small();
    folder.write("work.ckpt", "precious");
    folder.run(RENDER).refused(&["work.ckpt", "checkpoint"]);
    assert_eq!(folder.text("work.ckpt"), "precious");
    folder.run(&RENDER.replace("work.ckpt", "no/work.ckpt")).refused(&["no/work.ckpt"]);
    assert_eq!(folder.names(), ["small.obj", "work.ckpt"]);
}

#[cfg(unix)]
mod stopped {
    use std::{
        process::{Child, Command, Stdio},
        thread::sleep,
        time::Duration,
    };

    use super::{RENDER, uninterrupted};
    use crate::{
        interrupted::{catches, is_ignored, send, wait_until},
        support::Folder,
    };

    /// A render that takes a few seconds.
    fn slow(options: &str) -> String {
        RENDER.replace("--spp 8", options)
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
