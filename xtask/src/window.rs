//! `cargo xtask window`: the window of `canted view`, built with its feature and tested on a virtual X server.
//!
//! Not a part of `cargo xtask test`: the toolkit of the window takes minutes to compile.

use std::env;

use anyhow::{Result, bail};

use crate::command::{cargo, succeeds};

/// The folder of the build: in the usual one, other features of shared crates would compile nearly everything twice.
const TARGET: &str = "target/view";

/// Set where `cargo xtask ci` tests the window, too.
const VARIABLE: &str = "CANTED_WINDOW";

/// Builds and tests the window. Returns whether all tests passed.
pub(crate) fn run() -> Result<bool> {
    if let Some(reason) = missing() {
        bail!("{reason}");
    }
    let mut command = cargo(&["test", "--package", "canted-cli", "--features", "view", "--target-dir", TARGET]);
    // One display each, but the same cores: several windows at once would measure each other.
    command.args(["--lib", "--test", "program", "--", "view::", "window::", "--show-output", "--test-threads", "1"]);
    succeeds(&mut command)
}

/// Why the window is not tested here.
pub(crate) fn skipped() -> Option<String> {
    match env::var_os(VARIABLE) {
        None => Some(format!("{VARIABLE} is not set; `cargo xtask window` builds and tests the window")),
        Some(_) => missing(),
    }
}

/// The programs that are not installed.
fn missing() -> Option<String> {
    let folders = env::var_os("PATH").unwrap_or_default();
    let is_there = |name: &&str| env::split_paths(&folders).any(|folder| folder.join(name).is_file());
    let names: Vec<&str> = ["Xvfb", "xdotool", "xwd"].into_iter().filter(|name| !is_there(name)).collect();
    let packages = "on Debian and Ubuntu: apt-get install xvfb xdotool x11-apps libgl1-mesa-dri";
    (!names.is_empty()).then(|| format!("{} not installed ({packages})", names.join(", ")))
}
