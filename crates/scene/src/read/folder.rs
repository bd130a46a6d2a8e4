//! Files that a scene file names: only those in its own folder and below.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Why a named file is not read. The message does not repeat the name.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// The name is empty.
    NoName,
    /// The name leads out of the folder of the scene file.
    LeavesFolder,
    /// It names a folder, a device or a pipe.
    NotAFile,
    /// The system found or gave nothing.
    Io(io::Error),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoName => f.write_str("no file is named"),
            Self::LeavesFolder => f.write_str("the path leaves the folder of the scene"),
            Self::NotAFile => f.write_str("it is not a regular file"),
            Self::Io(source) => source.fmt(f),
        }
    }
}

/// The folder of a scene file; nothing outside it is opened on the file's behalf.
pub(crate) struct Folder {
    root: PathBuf,
    /// What was found, in an order that no thread decides.
    found: Mutex<BTreeSet<PathBuf>>,
}

impl Folder {
    /// The folder that contains `scene_file`.
    pub(crate) fn of(scene_file: &Path) -> io::Result<Self> {
        let parent = scene_file.parent().filter(|parent| !parent.as_os_str().is_empty());
        let root = fs::canonicalize(parent.unwrap_or(Path::new(".")))?;
        Ok(Self { root, found: Mutex::default() })
    }

    /// The real path of the regular file that `name` means; both slashes separate.
    ///
    /// Refused are absolute paths, paths that climb out by `..`, and links that point outside.
    pub(crate) fn resolve(&self, name: &str) -> Result<PathBuf, Refusal> {
        let name = name.replace('\\', "/");
        if name.trim().is_empty() {
            return Err(Refusal::NoName);
        }
        if climbs_out(Path::new(&name)) || has_drive(&name) {
            return Err(Refusal::LeavesFolder);
        }
        // Links are followed here, so what is compared is what will be opened.
        let real = fs::canonicalize(self.root.join(&name)).map_err(Refusal::Io)?;
        if !real.starts_with(&self.root) {
            return Err(Refusal::LeavesFolder);
        }
        if !fs::metadata(&real).map_err(Refusal::Io)?.is_file() {
            return Err(Refusal::NotAFile);
        }
        self.found.lock().unwrap_or_else(PoisonError::into_inner).insert(real.clone());
        Ok(real)
    }

    /// The real paths of the files that were found, each once.
    pub(crate) fn into_found(self) -> Vec<PathBuf> {
        self.found.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().collect()
    }

    /// The bytes of the file that `name` means.
    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, Refusal> {
        fs::read(self.resolve(name)?).map_err(Refusal::Io)
    }
}

/// Whether a path is absolute or steps above its start on the way.
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

/// Whether a name begins with a drive letter, also on systems that have none.
fn has_drive(name: &str) -> bool {
    matches!(name.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder `scene/` with `in.png` and `sub/deep.png`, beside it `out.png`.
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
    fn files_inside_are_read_by_either_slash() {
        let (_temp, folder) = folder();
        for name in ["in.png", "./in.png", "sub/../in.png", "sub/./../in.png", ".\\in.png"] {
            assert_eq!(folder.read(name).unwrap(), b"scene/in.png", "{name}");
        }
        assert_eq!(folder.read("sub\\deep.png").unwrap(), b"scene/sub/deep.png");
        let root = folder.root.clone();
        assert_eq!(folder.into_found(), ["in.png", "sub/deep.png"].map(|name| root.join(name)), "each is known once");
    }

    #[test]
    fn ways_out_are_refused() {
        let (temp, folder) = folder();
        let absolute = temp.path().join("scene/in.png").to_string_lossy().into_owned();
        for name in ["../out.png", "sub/../../out.png", "..\\out.png", "/etc/hostname", "c:\\out.png", &absolute] {
            assert!(matches!(folder.read(name), Err(Refusal::LeavesFolder)), "{name}");
        }
    }

    #[test]
    fn what_is_no_file_is_refused() {
        let (_temp, folder) = folder();
        assert!(matches!(folder.read("sub"), Err(Refusal::NotAFile)));
        assert!(matches!(folder.read(" "), Err(Refusal::NoName)));
        assert!(matches!(folder.read("absent.png"), Err(Refusal::Io(_))));
        assert!(matches!(folder.read("nul\0.png"), Err(Refusal::Io(_))));
    }

    #[cfg(unix)]
    #[test]
    fn links_may_point_inside_only() {
        let (temp, folder) = folder();
        std::os::unix::fs::symlink("../out.png", temp.path().join("scene/leak.png")).unwrap();
        std::os::unix::fs::symlink("..", temp.path().join("scene/up")).unwrap();
        std::os::unix::fs::symlink("in.png", temp.path().join("scene/fine.png")).unwrap();
        assert!(matches!(folder.read("leak.png"), Err(Refusal::LeavesFolder)));
        assert!(matches!(folder.read("up/out.png"), Err(Refusal::LeavesFolder)));
        assert_eq!(folder.read("fine.png").unwrap(), b"scene/in.png");
    }
}
