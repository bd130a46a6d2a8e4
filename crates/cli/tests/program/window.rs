//! The window of `canted view` on a virtual X server (`Xvfb`, `xdotool`, `xwd`), with events of mouse and keyboard as a person makes them.

use std::{
    io::{BufRead, BufReader, Read},
    process::{Child, ChildStdout, Command, Stdio},
    sync::mpsc::{self, Receiver},
    time::{Duration, Instant},
};

use canted_fixtures::skip;

use crate::support::Folder;

/// The picture that a command renders, row by row, and its size.
fn rendered(folder: &Folder, command: &str) -> (Vec<[u8; 3]>, [usize; 2]) {
    let words = command.strip_prefix("canted ").unwrap().split(" -o ").next().unwrap();
    folder.run(&format!("{words} -o render.png -q")).done();
    let picture = image::open(folder.path("render.png")).unwrap().into_rgb8();
    let size = [picture.width() as usize, picture.height() as usize];
    (picture.pixels().map(|pixel| pixel.0).collect(), size)
}

/// Whether the screen shows a picture: drivers may round colors to the next of 256.
fn is_shown(screen: &[[u8; 3]], picture: &[[u8; 3]]) -> bool {
    let pairs = screen.iter().flatten().zip(picture.iter().flatten());
    pairs.map(|(a, b)| a.abs_diff(*b)).max().is_some_and(|most| most <= 1)
}

/// A window that is driven, and what it prints.
struct Session<'a> {
    folder: &'a Folder,
    screen: &'a Screen,
    window: String,
    running: Running,
    lines: Receiver<String>,
}

impl<'a> Session<'a> {
    fn start(folder: &'a Folder, screen: &'a Screen, line: &str) -> Self {
        let mut command = folder.command(&format!("view {line} -v"));
        command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY").env("LIBGL_ALWAYS_SOFTWARE", "1");
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        let running = Running(child);
        Self { folder, screen, window: screen.window(" - canted"), running, lines }
    }

    /// Waits until the screen shows what a command renders.
    #[track_caller]
    fn shows(&self, command: &str) -> Vec<[u8; 3]> {
        let (picture, size) = rendered(self.folder, command);
        self.screen.wait_for(size, command, |screen| is_shown(screen, &picture))
    }

    /// Copies the command, and waits until the screen shows what it renders.
    #[track_caller]
    fn copied(&self) -> (String, Vec<[u8; 3]>) {
        self.does(&["key c"]);
        let command = self.lines.recv_timeout(LONGEST_WAIT).unwrap();
        let picture = self.shows(&command);
        (command, picture)
    }

    /// Runs commands of `xdotool`, with pauses as a person makes them.
    #[track_caller]
    fn does(&self, lines: &[&str]) {
        for line in lines {
            self.screen.xdotool(line);
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Closes the window by its key; returns what was written to standard error.
    #[track_caller]
    fn close(mut self) -> String {
        self.does(&["key Escape"]);
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.running.0.try_wait().unwrap() {
                break status;
            }
            assert!(start.elapsed() < LONGEST_WAIT, "the window does not close");
            std::thread::sleep(Duration::from_millis(20));
        };
        let mut stderr = String::new();
        self.running.0.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        assert_eq!(status.code(), Some(0), "{stderr}");
        stderr
    }
}

/// Runs a test, or skips it by name where a program is missing.
fn on_screen(size: [u32; 2], test: impl FnOnce(&Folder, &Screen)) {
    match missing() {
        Some(program) => drop(skip::<()>("the window", format_args!("{program} is not installed"))),
        None => test(&Folder::with_small(), &Screen::start(size)),
    }
}

const LINE: &str = "small.obj --size 320x240 --spp 4";

/// Each command that the window copies renders what the screen shows.
#[test]
fn the_window_shows_what_its_commands_render() {
    on_screen([800, 500], |folder, screen| {
        let session = Session::start(folder, screen, LINE);
        let first = session.shows("canted render small.obj --device=cpu --size=320x240 --spp=4 --denoise=off");
        session.does(&["mousemove 100 100", "mousedown 1", "mousemove 110 102", "mousemove 130 105"]);
        session.does(&["mousemove 160 110", "mouseup 1"]);
        let (command, orbited) = session.copied();
        assert!(command.contains("--eye=") && !is_shown(&first, &orbited), "{command}");
        session.does(&["mousedown 3", "mousemove 150 125", "mouseup 3", "key w", "key Left", "click 4"]);
        // The wheel turns smoothly, over some frames.
        std::thread::sleep(Duration::from_millis(600));
        let (command, moved) = session.copied();
        assert!(!is_shown(&orbited, &moved), "{command}");
        session.does(&["key b"]);
        let (command, boxes) = session.copied();
        assert!(command.contains("--boxes=0 ") && !is_shown(&moved, &boxes), "{command}");
        session.does(&["key x"]);
        let (command, boxes) = session.copied();
        assert!(command.contains("--accel=bvh2 --volumes=aabb"), "{command}");
        // The binary BVH of three triangles has levels below its root.
        session.does(&["key b"]);
        let (command, next) = session.copied();
        assert!(command.contains("--boxes=1 ") && !is_shown(&boxes, &next), "{command}");
        session.does(&["key Home"]);
        let (command, _) = session.copied();
        assert!(!command.contains("--eye="), "{command}");
        session.close();
    });
}

/// Other sizes, a window that is not on the screen for a while, a click.
#[test]
fn the_window_survives_what_windows_go_through() {
    on_screen([900, 600], |folder, screen| {
        let session = Session::start(folder, screen, LINE);
        session.shows("canted render small.obj --device=cpu --size=320x240 --spp=4 --denoise=off");
        session.does(&[&format!("windowsize --sync {} 700 310", session.window)]);
        let (command, _) = session.copied();
        assert!(command.contains("x310"), "{command}");
        session.does(&[&format!("windowunmap --sync {}", session.window)]);
        screen.wait_for([64, 64], "an empty screen", |pixels| pixels.iter().all(|pixel| *pixel == [0; 3]));
        session.does(&[&format!("windowmap --sync {}", session.window), &format!("windowfocus {}", session.window)]);
        session.shows(&command);
        // Ten pixels of height are too few for a picture with controls, but no reason to fail.
        session.does(&[&format!("windowsize {} 300 10", session.window), "mousemove 5 5"]);
        std::thread::sleep(Duration::from_millis(300));
        // 320 pixels to the left of the controls.
        session.does(&[&format!("windowsize --sync {} 584 560", session.window)]);
        session.shows("canted render small.obj --device=cpu --size=320x560 --spp=4 --denoise=off");
        let side = screen.picture([584, 560]);
        session.does(&["mousemove 160 280", "click 1"]);
        screen.wait_for([584, 560], "what is at a click", |pixels| {
            let in_panel = |i: usize| i % 584 > 330;
            pixels.iter().zip(&side).enumerate().filter(|(i, (a, b))| in_panel(*i) && a != b).count() > 100
        });
        session.close();
    });
}

/// The thread of the window waits for nothing: it answers while a picture takes long. Measured in the window, since the
/// times of `xdotool` are its own.
#[test]
fn the_window_answers_while_it_renders() {
    on_screen([800, 500], |folder, screen| {
        // Passes of thousands of samples take seconds each.
        let session = Session::start(folder, screen, "small.obj --size 320x240 --spp 60000 --integrator path");
        session.does(&["mousemove 100 100"]);
        for _ in 0..4 {
            session.does(&["mousedown 1", "mousemove 110 102", "mousemove 130 105", "mousemove 160 110", "mouseup 1"]);
            std::thread::sleep(Duration::from_millis(400));
            session.does(&["mousemove 100 100", "key x", "key e"]);
        }
        let start = Instant::now();
        let stderr = session.close();
        // Also the end does not wait for the passes.
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
        let line = stderr.lines().find(|line| line.contains("window: ")).unwrap_or_else(|| panic!("{stderr}"));
        let number = |before: &str| {
            let rest = line.split(before).nth(1).unwrap_or_else(|| panic!("no '{before}' in {line}"));
            rest.split_whitespace().next().unwrap().parse::<f64>().unwrap()
        };
        let (n_frames, n_long) = (number("window: "), number("ms, "));
        assert!(n_frames > 20.0 && n_long <= 0.1 * n_frames, "{line}");
    });
}

// A virtual X server, and a person before it: `Xvfb`, `xdotool` and `xwd`.

/// Time that any step may take on a busy machine.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// A running X server; ends on drop.
struct Screen {
    server: Child,
    display: String,
}

/// A program that ends on drop.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The first of the programs that is not installed.
fn missing() -> Option<&'static str> {
    let is_there = |name: &str| {
        let folders = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&folders).any(|folder| folder.join(name).is_file())
    };
    ["Xvfb", "xdotool", "xwd"].into_iter().find(|name| !is_there(name))
}

impl Screen {
    /// Starts a server on a display that nobody uses.
    fn start([width, height]: [u32; 2]) -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &format!("{width}x{height}x24")])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let stdout: ChildStdout = server.stdout.take().unwrap();
        let mut number = String::new();
        BufReader::new(stdout).read_line(&mut number).unwrap();
        Self { server, display: format!(":{}", number.trim()) }
    }

    /// Runs a command of `xdotool`; returns what it prints.
    #[track_caller]
    fn xdotool(&self, line: &str) -> String {
        let output =
            Command::new("xdotool").args(line.split_whitespace()).env("DISPLAY", &self.display).output().unwrap();
        assert!(output.status.success(), "xdotool {line}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// Waits for the window of a program, and brings it to the top left corner.
    #[track_caller]
    fn window(&self, name: &str) -> String {
        let start = Instant::now();
        loop {
            let search = Command::new("xdotool")
                .args(["search", "--onlyvisible", "--name", name])
                .env("DISPLAY", &self.display)
                .output()
                .unwrap();
            let ids = String::from_utf8(search.stdout).unwrap();
            if let Some(id) = ids.lines().next() {
                self.xdotool(&format!("windowmove {id} 0 0"));
                self.xdotool(&format!("windowfocus {id}"));
                return id.to_owned();
            }
            assert!(start.elapsed() < LONGEST_WAIT, "no window {name}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// The colors of the top left part of the screen, row by row.
    #[track_caller]
    fn picture(&self, [width, height]: [usize; 2]) -> Vec<[u8; 3]> {
        let mut xwd =
            Command::new("xwd").args(["-root", "-display", &self.display]).stdout(Stdio::piped()).spawn().unwrap();
        let mut bytes = Vec::new();
        xwd.stdout.take().unwrap().read_to_end(&mut bytes).unwrap();
        assert!(xwd.wait().unwrap().success());
        // XWDFileHeader: 32-bit numbers, most significant byte first.
        let number = |i: usize| u32::from_be_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap()) as usize;
        let (size, order, bits, stride, n_colors) = (number(0), number(7), number(11), number(12), number(19));
        // 24 where a window has another visual than the root.
        assert!(matches!(bits, 24 | 32) && order == 0, "pixels of three or four bytes, blue first");
        let start = size + 12 * n_colors;
        let pixel = |x: usize, y: usize| {
            let at = start + y * stride + bits / 8 * x;
            [bytes[at + 2], bytes[at + 1], bytes[at]]
        };
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
    }

    /// Waits until the top left part of the screen fulfills a condition; returns it.
    #[track_caller]
    fn wait_for(&self, size: [usize; 2], what: &str, is_so: impl Fn(&[[u8; 3]]) -> bool) -> Vec<[u8; 3]> {
        let start = Instant::now();
        loop {
            let picture = self.picture(size);
            if is_so(&picture) {
                return picture;
            }
            assert!(start.elapsed() < LONGEST_WAIT, "the screen does not show {what}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}
