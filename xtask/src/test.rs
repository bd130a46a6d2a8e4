//! `cargo xtask test`: runs and counts all tests of the workspace, then those of the Python package and of the example in a browser;
//! finds a GPU driver for them, or installs the software driver where that is allowed.

use std::{
    env,
    path::Path,
    process::{Command, Stdio},
};

use anyhow::Result;

use crate::{
    browser,
    command::{self, Count, files_with, say},
    python,
};

/// Runs all tests and prints their count last. Returns whether none failed.
pub(crate) fn run() -> Result<bool> {
    let (count, is_well) = count()?;
    say(&count.to_string());
    Ok(is_well)
}

/// Runs all tests of all packages, also after a failure. Returns their count and whether all passed.
pub(crate) fn count() -> Result<(Count, bool)> {
    let models = command::models();
    if !models.is_dir() {
        say(&format!("skipped tests of real models: no folder {} (set CANTED_SCENES)", models.display()));
    }
    let mut cargo = command::cargo(&["test", "--workspace", "--no-fail-fast"]);
    if ensure_driver() {
        // With a driver that opens no device, tests of devices would be ignored one and all.
        cargo.env("CANTED_REQUIRE_DEVICE", "1");
    }
    // Silences the device selection layer of Mesa.
    cargo.env("NODEVICE_SELECT", "1");
    let mut count = Count::default();
    let is_well = command::for_each_line(&mut cargo, |line| {
        count.add(line);
        say(line);
    })?;
    if !is_well && count.failed == 0 {
        // A program that does not compile, or is killed by a signal, names no test.
        count.failed = 1;
        say("cargo test failed outside of any test: counted as one failure");
    }
    let is_well = python::test(&mut count)? && is_well;
    let is_well = browser::test(&mut count)? && is_well;
    Ok((count, is_well))
}

/// Folders that the Vulkan loader searches for driver manifests.
const FOLDERS: [&str; 4] =
    ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/local/etc/vulkan/icd.d"];

/// Packages of the loader and of the software driver on Debian and Ubuntu.
const PACKAGES: [&str; 2] = ["libvulkan1", "mesa-vulkan-drivers"];

/// Whether GPU tests have a driver. Installs the software driver where there is none and the user is root.
fn ensure_driver() -> bool {
    if !cfg!(target_os = "linux") {
        // Metal and DX12 come with the system.
        return cfg!(any(target_os = "macos", target_os = "windows"));
    }
    let is_there = || {
        ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|name| env::var_os(name).is_some())
            || FOLDERS.iter().any(|folder| !files_with(Path::new(folder), "json").is_empty())
    };
    if is_there() {
        return true;
    }
    let id = Command::new("id").arg("-u").stderr(Stdio::null()).output();
    if id.is_ok_and(|output| output.stdout.trim_ascii() == b"0") {
        // Package lists may be missing or outdated.
        apt(&["update", "-qq"]);
        apt(&[&["install", "-y", "-qq", "--no-install-recommends"], &PACKAGES[..]].concat());
        if is_there() {
            say("installed Mesa's software driver for the GPU tests");
            return true;
        }
    }
    let packages = PACKAGES.join(" ");
    say(&format!("skipped GPU tests: no Vulkan driver found (on Debian and Ubuntu: apt-get install {packages})"));
    false
}

fn apt(words: &[&str]) {
    let mut command = command::program("apt-get", words);
    // Whether it succeeded shows in what is installed.
    let _ = command.env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null()).status();
}
