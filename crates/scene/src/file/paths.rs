//! Relative paths between folders.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use super::{AssetSource, EnvironmentSource, SceneFile};
use crate::ReadError;

impl SceneFile {
    /// Resolves a path in this file.
    pub(super) fn resolve(&self, file: &str) -> PathBuf {
        folder(&self.path).join(file)
    }

    /// Moves the scene file to `path`, rewriting its relative paths to refer to the same files.
    ///
    /// # Errors
    /// A referenced file does not exist, or its path is not UTF-8.
    pub fn moved_to(mut self, path: &Path) -> Result<Self, ReadError> {
        let from = folder(&self.path).to_owned();
        let to = folder(path);
        for file in self.files_mut() {
            *file = relative(&from.join(&file), to)?;
        }
        path.clone_into(&mut self.path);
        Ok(self)
    }

    /// Resolved paths of all files that this one references.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        self.clone().files_mut().map(|file| self.resolve(file)).collect()
    }

    /// All file names in this file.
    fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let assets = self.assets.iter_mut().filter_map(|asset| match &mut asset.source {
            AssetSource::File(file) => Some(file),
            AssetSource::Builtin => None,
        });
        let environment = self.environment.iter_mut().filter_map(|environment| match environment {
            EnvironmentSource::Image { file, .. } => Some(file),
            EnvironmentSource::Constant(_) => None,
        });
        let materials = self.materials.iter_mut().flat_map(|material| material.edits.files_mut());
        let overrides = self.overrides.iter_mut().flat_map(|change| change.edits.files_mut());
        assets.chain(environment).chain(materials).chain(overrides)
    }
}

/// The folder of a file; empty for the current folder.
pub(super) fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// `.` for the empty path.
fn or_current(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

/// The path from `folder` to `file`, separated by `/`. Both must exist.
pub(super) fn relative(file: &Path, folder: &Path) -> Result<String, ReadError> {
    let real = |path: &Path| fs::canonicalize(path).map_err(|source| ReadError::Io { path: path.to_owned(), source });
    let not_utf8 = || {
        let source = io::Error::new(io::ErrorKind::InvalidInput, "the path is not UTF-8");
        ReadError::Io { path: file.to_owned(), source }
    };
    // Does not follow a link in the last component: files it references lie next to the link.
    let target = match (real(file)?, file.file_name()) {
        (_, Some(name)) => real(or_current(self::folder(file)))?.join(name),
        (target, None) => target,
    };
    let folder = real(or_current(folder))?;
    let n_common = target.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if target.components().take(n_common).all(|component| matches!(component, Component::Prefix(_))) {
        // Another drive: no relative path exists.
        return target.to_str().map(str::to_owned).ok_or_else(not_utf8);
    }
    let up = folder.components().skip(n_common).map(|_| Some(".."));
    let down = target.components().skip(n_common).map(|component| component.as_os_str().to_str());
    let names: Option<Vec<&str>> = up.chain(down).collect();
    Ok(names.ok_or_else(not_utf8)?.join("/"))
}
