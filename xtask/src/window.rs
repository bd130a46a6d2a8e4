//! `cargo xtask window`: the window of `canted view`, built with its feature and tested on a virtual X server.
//!
//! Not a part of `cargo xtask test`: the toolkit of the window takes minutes to compile.

use std::{env, process::Command};

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

/// The library that the toolkit of the window opens at run time on X servers.
const LIBRARY: &str = "libxkbcommon-x11.so.0";

/// The programs and libraries that are not installed.
fn missing() -> Option<String> {
    let folders = env::var_os("PATH").unwrap_or_default();
    let is_there = |name: &&str| env::split_paths(&folders).any(|folder| folder.join(name).is_file());
    let mut names: Vec<&str> = ["Xvfb", "xdotool", "xwd"].into_iter().filter(|name| !is_there(name)).collect();
    names.extend((!has_library()).then_some(LIBRARY));
    let packages = "on Debian and Ubuntu: apt-get install xvfb xdotool x11-apps libgl1-mesa-dri libxkbcommon-x11-0";
    (!names.is_empty()).then(|| format!("{} not installed ({packages})", names.join(", ")))
}

/// Whether the loader knows the library; also true where there is no list of libraries.
fn has_library() -> bool {
    // Some users have no folder of system programs in their `PATH`.
    let lists = ["ldconfig", "/sbin/ldconfig"]
        .into_iter()
        .filter_map(|program| Command::new(program).arg("-p").output().ok().filter(|list| list.status.success()));
    lists.map(|list| String::from_utf8_lossy(&list.stdout).contains(LIBRARY)).next().unwrap_or(true)
}
