use std::path::{Path, PathBuf};

use super::Library;

/// Names under which systems install the library, newest first.
const INSTALLED: [&str; 2] = ["libembree4.so.4", "libembree3.so.3"];

/// Every available Embree, one per version, newest first: those that `CANTED_EMBREE` names (files, or folders that
/// contain them, separated as in `PATH`), then those that the system's loader finds.
#[must_use]
pub fn libraries() -> Vec<Library> {
    let named = std::env::var_os("CANTED_EMBREE").unwrap_or_default();
    let mut libraries: Vec<Library> = vec![];
    let paths = std::env::split_paths(&named).flat_map(|path| files(&path)).chain(INSTALLED.map(PathBuf::from));
    for path in paths {
        if let Ok(library) = Library::open(&path)
            && libraries.iter().all(|known| known.version() != library.version())
        {
            libraries.push(library);
        }
    }
    libraries.sort_by_key(|library| std::cmp::Reverse(library.version()));
    libraries
}

/// The path itself, or the Embree libraries in the folder.
fn files(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = path.read_dir() else { return vec![path.to_owned()] };
    let is_embree = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| name.starts_with("libembree"))
    };
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_embree).collect();
    files.sort();
    files
}
