//! A virtual X server, and a person before it: `Xvfb`, `xdotool` and `xwd`.

use std::{
    io::{BufRead, BufReader, Read},
    process::{Child, ChildStdout, Command, Stdio},
    time::{Duration, Instant},
};

/// Time that any step may take on a busy machine.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);

/// A running X server; ends on drop.
pub(super) struct Screen {
    server: Child,
    pub(super) display: String,
}

/// A program that ends on drop.
pub(super) struct Running(pub(super) Child);

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
pub(super) fn missing() -> Option<&'static str> {
    let is_there = |name: &str| {
        let folders = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&folders).any(|folder| folder.join(name).is_file())
    };
    ["Xvfb", "xdotool", "xwd"].into_iter().find(|name| !is_there(name))
}

impl Screen {
    /// Starts a server on a display that nobody uses.
    pub(super) fn start([width, height]: [u32; 2]) -> Self {
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
    pub(super) fn xdotool(&self, line: &str) -> String {
        let output =
            Command::new("xdotool").args(line.split_whitespace()).env("DISPLAY", &self.display).output().unwrap();
        assert!(output.status.success(), "xdotool {line}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// Waits for the window of a program, and brings it to the top left corner.
    #[track_caller]
    pub(super) fn window(&self, name: &str) -> String {
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
            assert!(start.elapsed() < PATIENCE, "no window {name}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// The colors of the top left part of the screen, row by row.
    #[track_caller]
    pub(super) fn picture(&self, [width, height]: [usize; 2]) -> Vec<[u8; 3]> {
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
    pub(super) fn wait_for(&self, size: [usize; 2], what: &str, is_so: impl Fn(&[[u8; 3]]) -> bool) -> Vec<[u8; 3]> {
        let start = Instant::now();
        loop {
            let picture = self.picture(size);
            if is_so(&picture) {
                return picture;
            }
            assert!(start.elapsed() < PATIENCE, "the screen does not show {what}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}
