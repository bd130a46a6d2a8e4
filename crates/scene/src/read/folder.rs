//! Restricts referenced files to the folder of the referencing file, and finds images whose paths are those of another machine.

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::input::ReadOptions;

const OUTSIDE: &str = "the path is outside the folder of the scene";
const ABOVE: &str = "the path is outside the folder of the scene; --allow-parent permits it";

/// Last components of a path by which an image is searched for.
const MAX_COMPONENTS: usize = 16;

/// The folder of a file; files outside it are not opened on behalf of that file, unless the options permit it.
pub(crate) struct Folder {
    root: PathBuf,
    /// Further folders of images.
    texture_paths: Vec<PathBuf>,
    allow_parent: bool,
    /// Resolved files, sorted so that the order does not depend on threads.
    found: Mutex<BTreeSet<PathBuf>>,
    /// Sorted names of the files in folders that were searched, in lower case and as they are.
    listings: Mutex<HashMap<PathBuf, Vec<(String, String)>>>,
}

impl Folder {
    /// The folder that contains `file`.
    pub(crate) fn of(file: &Path, options: &ReadOptions) -> io::Result<Self> {
        let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty());
        let root = fs::canonicalize(parent.unwrap_or(Path::new(".")))?;
        let texture_paths = options.texture_paths.iter().map(fs::canonicalize).collect::<io::Result<_>>()?;
        let (found, listings) = (Mutex::default(), Mutex::default());
        Ok(Self { root, texture_paths, allow_parent: options.allow_parent, found, listings })
    }

    /// The canonical path of the regular file `name`; `/` and `\` both separate components.
    ///
    /// Rejects absolute paths, and unless the options permit it paths that leave the folder by `..`, and links to the outside. Errors
    /// do not contain the name.
    pub(crate) fn resolve(&self, name: &str) -> Result<PathBuf, String> {
        let name = name.replace('\\', "/");
        if name.trim().is_empty() {
            return Err("empty file name".to_owned());
        }
        if has_drive(&name) || Path::new(&name).has_root() {
            return Err(OUTSIDE.to_owned());
        }
        if climbs_out(Path::new(&name)) && !self.allow_parent {
            return Err(ABOVE.to_owned());
        }
        self.within(&self.root, Path::new(&name))
    }

    /// The canonical path of a regular file in a folder.
    fn within(&self, folder: &Path, name: &Path) -> Result<PathBuf, String> {
        // Follows links, so that the compared path is the one that is opened.
        let real = fs::canonicalize(folder.join(name)).map_err(|error| error.to_string())?;
        if !real.starts_with(folder) && !self.allow_parent {
            return Err(ABOVE.to_owned());
        }
        if !fs::metadata(&real).map_err(|error| error.to_string())?.is_file() {
            return Err("not a regular file".to_owned());
        }
        self.found.lock().unwrap_or_else(PoisonError::into_inner).insert(real.clone());
        Ok(real)
    }

    /// As [`Folder::resolve`]; where that does not find the file, as much of the end of its path as exists in the folder or in one of
    /// the further folders, where the case of letters may differ: a path may be that of another machine.
    pub(crate) fn find(&self, name: &str) -> Result<PathBuf, String> {
        let error = match self.resolve(name) {
            Ok(path) => return Ok(path),
            Err(error) => error,
        };
        let name = name.trim().replace('\\', "/");
        let path = if has_drive(&name) { &name[2..] } else { &name };
        let components: Vec<&str> =
            path.split('/').filter(|component| !component.is_empty() && *component != ".").collect();
        let below = components.rsplit(|component| *component == "..").next().unwrap_or_default();
        let first = below.len().saturating_sub(MAX_COMPONENTS);
        for folder in std::iter::once(&self.root).chain(&self.texture_paths) {
            let mut ends = (first..below.len()).filter_map(|start| self.similar(folder, &below[start..]));
            if let Some(path) = ends.find_map(|end| self.within(folder, &end).ok()) {
                return Ok(path);
            }
        }
        Err(error)
    }

    /// The path below a folder whose components are these, but for the case of letters; an equal one takes precedence.
    fn similar(&self, folder: &Path, components: &[&str]) -> Option<PathBuf> {
        let mut path = folder.to_owned();
        for component in components {
            let same = path.join(component);
            let is_there = fs::symlink_metadata(&same).is_ok();
            path = if is_there { same } else { path.join(self.name_like(&path, component)?) };
        }
        Some(path)
    }

    /// The first name in a folder that differs from this one only in the case of letters.
    fn name_like(&self, folder: &Path, name: &str) -> Option<String> {
        let mut listings = self.listings.lock().unwrap_or_else(PoisonError::into_inner);
        let names = listings.entry(folder.to_owned()).or_insert_with(|| {
            let entries = fs::read_dir(folder).into_iter().flatten().flatten();
            let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
            let mut names: Vec<_> = names.map(|name| (name.to_lowercase(), name)).collect();
            names.sort_unstable();
            names
        });
        let wanted = name.to_lowercase();
        let first = names.partition_point(|(lower, _)| *lower < wanted);
        names.get(first).filter(|(lower, _)| *lower == wanted).map(|(_, name)| name.clone())
    }

    /// Canonical paths of all files resolved so far, each once.
    pub(crate) fn found(&self) -> Vec<PathBuf> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }

    /// Reads the file `name`, or where there is none one whose name differs in the case of letters only.
    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        let path = self.resolve(name).or_else(|error| self.in_any_case(name).ok_or(error))?;
        fs::read(path).map_err(|error| error.to_string())
    }

    /// A file below the folder by a name of this form without `..`.
    fn in_any_case(&self, name: &str) -> Option<PathBuf> {
        let name = name.replace('\\', "/");
        let components: Vec<&str> = name.split('/').filter(|&component| component != ".").collect();
        let is_below =
            !has_drive(&name) && components.iter().all(|&component| !component.is_empty() && component != "..");
        let path = is_below.then(|| self.similar(&self.root, &components))??;
        self.within(&self.root, &path).ok()
    }

    /// Reads the file that [`Folder::find`] finds.
    pub(crate) fn read_image(&self, name: &str) -> Result<Vec<u8>, String> {
        fs::read(self.find(name)?).map_err(|error| error.to_string())
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
        let folder = Folder::of(&temp.path().join("scene/model.obj"), &ReadOptions::default()).unwrap();
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
        for name in ["../out.png", "sub/../../out.png", "..\\out.png"] {
            assert_eq!(folder.read(name).unwrap_err(), ABOVE, "{name}");
            assert_eq!(folder.read_image(name).unwrap_err(), ABOVE, "{name}");
            let options = ReadOptions { allow_parent: true, ..ReadOptions::default() };
            let permitted = Folder::of(&temp.path().join("scene/model.obj"), &options).unwrap();
            assert_eq!(permitted.read(name).unwrap(), b"out.png", "{name}");
        }
        for name in ["/etc/hostname", "c:\\out.png", &absolute] {
            assert_eq!(folder.read(name).unwrap_err(), OUTSIDE, "{name}");
        }
    }

    #[test]
    fn finds_images_of_other_machines() {
        let (temp, folder) = folder();
        for name in [
            "in.png",
            "IN.Png",
            "C:\\Users\\someone\\maps\\In.PNG",
            "/home/someone/in.png",
            "\\\\server\\share\\in.png",
            "../elsewhere/in.png",
            "no/such/folder/in.png",
            "C:in.png",
        ] {
            let found = folder.read_image(name);
            assert_eq!(found.unwrap_or_else(|error| panic!("{name}: {error}")), b"scene/in.png", "{name}");
        }
        for name in ["Sub/DEEP.png", "/home/someone/scene/sub/deep.png", "D:/a/SUB/Deep.png"] {
            assert_eq!(folder.read_image(name).unwrap(), b"scene/sub/deep.png", "{name}");
        }
        assert!(folder.read_image("deep.png").is_err(), "folders below are not searched");
        assert_eq!(folder.read_image("/etc/hostname").unwrap_err(), OUTSIDE);

        fs::create_dir_all(temp.path().join("maps/more")).unwrap();
        for name in ["maps/Other.png", "maps/more/a.png", "maps/in.png"] {
            fs::write(temp.path().join(name), name).unwrap();
        }
        let options = ReadOptions { texture_paths: vec![temp.path().join("maps")], ..ReadOptions::default() };
        let folder = Folder::of(&temp.path().join("scene/model.obj"), &options).unwrap();
        for (name, content) in [
            ("other.png", "maps/Other.png"),
            ("textures/OTHER.PNG", "maps/Other.png"),
            ("E:\\work\\more\\a.png", "maps/more/a.png"),
            ("in.png", "scene/in.png"),
        ] {
            assert_eq!(folder.read_image(name).unwrap(), content.as_bytes(), "{name}");
        }
        assert!(folder.read("Other.png").is_err(), "only images");
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
        assert_eq!(folder.read("leak.png").unwrap_err(), ABOVE);
        assert_eq!(folder.read("up/out.png").unwrap_err(), ABOVE);
        assert!(folder.read_image("UP/OUT.png").is_err());
        assert_eq!(folder.read("fine.png").unwrap(), b"scene/in.png");
    }
}
