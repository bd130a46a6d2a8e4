//! Finds a GPU driver for the tests, or installs the software driver where that is allowed.

use std::{
    env, fs,
    path::Path,
    process::{Command, Stdio},
};

use crate::command::say;

/// Folders that the Vulkan loader searches for driver manifests.
const FOLDERS: [&str; 4] =
    ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/local/etc/vulkan/icd.d"];

/// Packages of the loader and of the software driver on Debian and Ubuntu.
const PACKAGES: [&str; 2] = ["libvulkan1", "mesa-vulkan-drivers"];

/// Silences the device selection layer of Mesa.
const QUIET: [(&str, &str); 1] = [("NODEVICE_SELECT", "1")];

/// Whether GPU tests have a driver. Installs the software driver where there is none and the user is root.
pub(crate) fn ensure() -> bool {
    if is_there() {
        return true;
    }
    if !cfg!(target_os = "linux") {
        // Metal and DX12 come with the system.
        return cfg!(any(target_os = "macos", target_os = "windows"));
    }
    if is_root() && install() && is_there() {
        say("installed Mesa's software driver for the GPU tests");
        return true;
    }
    let packages = PACKAGES.join(" ");
    say(&format!("skipped GPU tests: no Vulkan driver found (on Debian and Ubuntu: apt-get install {packages})"));
    false
}

/// Silences the driver in a command.
pub(crate) fn quieten(command: &mut Command) {
    command.envs(QUIET);
}

fn is_there() -> bool {
    if ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|name| env::var_os(name).is_some()) {
        return true;
    }
    FOLDERS.iter().any(|folder| names_a_driver(Path::new(folder)))
}

fn names_a_driver(folder: &Path) -> bool {
    let Ok(entries) = fs::read_dir(folder) else { return false };
    entries.flatten().any(|entry| entry.path().extension().is_some_and(|extension| extension == "json"))
}

fn is_root() -> bool {
    let output = Command::new("id").arg("-u").stderr(Stdio::null()).output();
    output.is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

fn install() -> bool {
    // Package lists may be missing or outdated.
    apt(&["update", "-qq"]);
    let words = ["install", "-y", "-qq", "--no-install-recommends"];
    apt(&[&words[..], &PACKAGES[..]].concat())
}

fn apt(words: &[&str]) -> bool {
    let mut command = Command::new("apt-get");
    command.args(words).env("DEBIAN_FRONTEND", "noninteractive").stdin(Stdio::null()).stdout(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_is_a_json_file_in_one_of_the_folders() {
        let folder = crate::workspace::root().join("target/xtask-driver-test");
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("notes.txt"), "").unwrap();
        assert!(!names_a_driver(&folder) && !names_a_driver(&folder.join("missing")));
        fs::write(folder.join("some_icd.json"), "{}").unwrap();
        assert!(names_a_driver(&folder));
        fs::remove_dir_all(&folder).unwrap();
    }
}
