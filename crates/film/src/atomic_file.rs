//! A file that is written to a temporary name and renamed, and why a file was not read or written.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Temporary files of this process.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Deletes all temporary files, for a process that is about to exit.
///
/// While the returned value exists, other threads wait before they create, finish or drop an [`AtomicFile`].
pub fn discard_unfinished() -> Discarded {
    let files = unfinished();
    files.iter().for_each(|file| drop(fs::remove_file(file)));
    Discarded { _held: files }
}

/// No temporary file exists, see [`discard_unfinished`].
#[must_use = "files may be created again once it is dropped"]
#[derive(Debug)]
pub struct Discarded {
    _held: MutexGuard<'static, Vec<PathBuf>>,
}

/// A temporary file in the folder of its target: [`AtomicFile::finish`] renames it, dropping it deletes it.
#[derive(Debug)]
pub struct AtomicFile {
    /// The path in errors.
    path: PathBuf,
    /// The path with links resolved, so that the file changes and the link stays.
    target: PathBuf,
    temporary: PathBuf,
    writer: BufWriter<File>,
}

impl AtomicFile {
    /// Creates the temporary file, with the permissions of new files in that folder.
    ///
    /// # Errors
    /// [`FileError`] if `path` cannot be written, or is a folder, a device or a pipe, which a file would replace.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        match fs::metadata(&target) {
            Ok(found) if found.is_dir() => return Err(FileError::write(path, "it is a folder")),
            Ok(found) if !found.is_file() => return Err(FileError::write(path, "not a regular file")),
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(write_error(path, &error)),
            _ => {}
        }
        // Created and listed under one lock, so that no file is missing in the list.
        let mut unfinished = unfinished();
        let (temporary, file) = create_beside(&target).map_err(|error| write_error(path, &error))?;
        unfinished.push(temporary.clone());
        Ok(Self { path: path.to_owned(), target, temporary, writer: BufWriter::new(file) })
    }

    /// Calls `content` with the buffered file.
    ///
    /// # Errors
    /// [`FileError`] with the file and the reason, including an error of `content`.
    pub fn write(&mut self, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), FileError> {
        content(&mut self.writer).map_err(|error| write_error(&self.path, &error))
    }

    /// Renames the file, replacing the previous one.
    ///
    /// # Errors
    /// [`FileError`] with the file and the reason; the previous file remains.
    pub fn finish(mut self) -> Result<(), FileError> {
        let mut rename = || {
            self.writer.flush()?;
            self.writer.get_ref().sync_all()?;
            let _unfinished = unfinished();
            fs::rename(&self.temporary, &self.target)
        };
        rename().map_err(|error| write_error(&self.path, &error))
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        let mut unfinished = unfinished();
        unfinished.retain(|file| *file != self.temporary);
        // A finished file no longer has this name.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Writes a file of these bytes.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let mut file = AtomicFile::create(path)?;
    file.write(|out| out.write_all(bytes))?;
    file.finish()
}

/// Reads a file and decodes it.
pub(crate) fn read_file<T>(path: &Path, decode: impl FnOnce(&[u8]) -> Result<T, String>) -> Result<T, FileError> {
    let bytes = fs::read(path).map_err(|error| FileError::read(path, error))?;
    decode(&bytes).map_err(|reason| FileError::read(path, reason))
}

/// Creates a file in the folder of `path` with a name that no other call or process uses.
fn create_beside(path: &Path) -> io::Result<(PathBuf, File)> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    loop {
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        // Without the name of the file, which may have the maximum length.
        let temporary = path.with_file_name(format!(".canted-{}-{number}.tmp", std::process::id()));
        match File::create_new(&temporary) {
            // In containers, processes have equal numbers, and one that was killed leaves its file.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            created => return created.map(|file| (temporary, file)),
        }
    }
}

/// The system's reason without its error number.
fn write_error(path: &Path, error: &io::Error) -> FileError {
    let text = error.to_string();
    FileError::write(path, text.split(" (os error").next().unwrap_or(&text).to_lowercase())
}

/// Why a file was not read or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    action: &'static str,
    path: PathBuf,
    reason: String,
}

impl FileError {
    fn read(path: &Path, reason: impl fmt::Display) -> Self {
        Self { action: "read", path: path.to_owned(), reason: reason.to_string() }
    }

    pub(crate) fn write(path: &Path, reason: impl fmt::Display) -> Self {
        Self { action: "write", path: path.to_owned(), reason: reason.to_string() }
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot {} {}: {}", self.action, self.path.display(), self.reason)
    }
}

impl std::error::Error for FileError {}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_link_stays_and_its_file_changes() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        symlink("file", &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["file", "link"]);
    }

    #[test]
    fn special_files_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let error = write_file(&path, b"").unwrap_err();
        assert_eq!(error.to_string(), format!("cannot write {}: not a regular file", path.display()));
        assert!(!fs::metadata(&path).unwrap().is_file());
    }

    #[test]
    fn a_dropped_file_is_deleted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut file = AtomicFile::create(&path).unwrap();
        assert_eq!(names(folder.path()).len(), 1);
        let error = file.write(|_| Err(io::Error::other("of the caller"))).unwrap_err();
        assert_eq!(error.to_string(), format!("cannot write {}: of the caller", path.display()));
        drop(file);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn files_that_a_killed_process_left_are_passed_by() {
        let folder = tempfile::tempdir().unwrap();
        let left = |n: u32| folder.path().join(format!(".canted-{}-{n}.tmp", std::process::id()));
        // Other tests of this process count as well.
        (0..1000).for_each(|n| fs::write(left(n), "left").unwrap());
        let path = folder.path().join("file");
        write_file(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!((0..1000).all(|n| fs::read(left(n)).unwrap() == b"left"));
    }

    #[test]
    fn names_may_have_the_maximum_length() {
        let folder = tempfile::tempdir().unwrap();
        write_file(&folder.path().join("x".repeat(255)), b"").unwrap();
    }

    #[test]
    fn new_files_have_default_permissions() {
        let folder = tempfile::tempdir().unwrap();
        let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        fs::write(folder.path().join("other"), "").unwrap();
        write_file(&folder.path().join("ours"), b"").unwrap();
        assert_eq!(mode("ours"), mode("other"));
    }
}
