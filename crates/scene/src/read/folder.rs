//! Restricts referenced files to the folder of the referencing file.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

const OUTSIDE: &str = "the path is outside the folder of the scene";

/// The folder of a file; files outside it are never opened on behalf of that file.
pub(crate) struct Folder {
    root: PathBuf,
    /// Resolved files, sorted so that the order does not depend on threads.
    found: Mutex<BTreeSet<PathBuf>>,
}

impl Folder {
    /// The folder that contains `file`.
    pub(crate) fn of(file: &Path) -> io::Result<Self> {
        let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty());
        let root = fs::canonicalize(parent.unwrap_or(Path::new(".")))?;
        Ok(Self { root, found: Mutex::default() })
    }

    /// The canonical path of the regular file `name`; `/` and `\` both separate components.
    ///
    /// Rejects absolute paths, paths that leave the folder by `..`, and links to the outside. Errors do not contain the name.
    pub(crate) fn resolve(&self, name: &str) -> Result<PathBuf, String> {
        let name = name.replace('\\', "/");
        if name.trim().is_empty() {
            return Err("empty file name".to_owned());
        }
        if climbs_out(Path::new(&name)) || has_drive(&name) {
            return Err(OUTSIDE.to_owned());
        }
        // Follows links, so that the compared path is the one that is opened.
        let real = fs::canonicalize(self.root.join(&name)).map_err(|error| error.to_string())?;
        if !real.starts_with(&self.root) {
            return Err(OUTSIDE.to_owned());
        }
        if !fs::metadata(&real).map_err(|error| error.to_string())?.is_file() {
            return Err("not a regular file".to_owned());
        }
        self.found.lock().unwrap_or_else(PoisonError::into_inner).insert(real.clone());
        Ok(real)
    }

    /// Canonical paths of all files resolved so far, each once.
    pub(crate) fn found(&self) -> Vec<PathBuf> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }

    /// Reads the file `name`.
    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        fs::read(self.resolve(name)?).map_err(|error| error.to_string())
    }
}

/// Whether a path is absolute or goes above its start at any component.
fn climbs_out(path: &Path) -> bool {
    let mut depth = 0_usize;
    for component in path.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir if depth > 0 => depth -= 1,
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return true,
        }
    }
    false
}

/// Whether a name starts with a drive letter, on any operating system.
fn has_drive(name: &str) -> bool {
    matches!(name.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder `scene/` with `in.png` and `sub/deep.png`, next to `out.png`.
    fn folder() -> (tempfile::TempDir, Folder) {
        let temp = tempfile::tempdir().unwrap();
        fs::create_dir_all(temp.path().join("scene/sub")).unwrap();
        for name in ["scene/in.png", "scene/sub/deep.png", "out.png"] {
            fs::write(temp.path().join(name), name).unwrap();
        }
        let folder = Folder::of(&temp.path().join("scene/model.obj")).unwrap();
        (temp, folder)
    }

    #[test]
    fn reads_files_inside_with_either_separator() {
        let (_temp, folder) = folder();
        for name in ["in.png", "./in.png", "sub/../in.png", "sub/./../in.png", ".\\in.png"] {
            assert_eq!(folder.read(name).unwrap(), b"scene/in.png", "{name}");
        }
        assert_eq!(folder.read("sub\\deep.png").unwrap(), b"scene/sub/deep.png");
        let root = folder.root.clone();
        assert_eq!(folder.found(), ["in.png", "sub/deep.png"].map(|name| root.join(name)), "each file is listed once");
    }

    #[test]
    fn rejects_paths_that_leave_the_folder() {
        let (temp, folder) = folder();
        let absolute = temp.path().join("scene/in.png").to_string_lossy().into_owned();
        for name in ["../out.png", "sub/../../out.png", "..\\out.png", "/etc/hostname", "c:\\out.png", &absolute] {
            assert_eq!(folder.read(name).unwrap_err(), OUTSIDE, "{name}");
        }
    }

    #[test]
    fn rejects_folders_and_missing_files() {
        let (_temp, folder) = folder();
        assert_eq!(folder.read("sub").unwrap_err(), "not a regular file");
        assert_eq!(folder.read(" ").unwrap_err(), "empty file name");
        assert!(folder.read("absent.png").is_err());
        assert!(folder.read("nul\0.png").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn rejects_links_to_the_outside() {
        let (temp, folder) = folder();
        std::os::unix::fs::symlink("../out.png", temp.path().join("scene/leak.png")).unwrap();
        std::os::unix::fs::symlink("..", temp.path().join("scene/up")).unwrap();
        std::os::unix::fs::symlink("in.png", temp.path().join("scene/fine.png")).unwrap();
        assert_eq!(folder.read("leak.png").unwrap_err(), OUTSIDE);
        assert_eq!(folder.read("up/out.png").unwrap_err(), OUTSIDE);
        assert_eq!(folder.read("fine.png").unwrap(), b"scene/in.png");
    }
}
