//! A file that appears under its name whole or not at all.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Temporary files of this process that have no name yet.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes away what is there of files in the making, for a process that is about to end without coming back to them.
///
/// While the value lives no file is begun, named or given up: whoever tries waits, so that nothing appears behind it.
pub fn discard_unfinished() -> Discarded {
    let files = unfinished();
    files.iter().for_each(|file| drop(fs::remove_file(file)));
    Discarded { _held: files }
}

/// Nothing is left of files in the making: [`discard_unfinished`].
#[must_use = "files may be begun again once it is dropped"]
#[derive(Debug)]
pub struct Discarded {
    _held: MutexGuard<'static, Vec<PathBuf>>,
}

/// A file in the making, beside the one that it is to be: [`AtomicFile::finish`] gives it its name, and without that nothing is
/// left of it.
#[derive(Debug)]
pub struct AtomicFile {
    /// The name that errors say.
    path: PathBuf,
    /// What that name means: links are followed, so that the file changes and the link stays.
    target: PathBuf,
    temporary: PathBuf,
    writer: BufWriter<File>,
}

impl AtomicFile {
    /// Opens a temporary file in the folder of `path`, readable by whoever may read new files there.
    ///
    /// # Errors
    /// [`WriteError`] where `path` cannot be written, or names a folder, a device or a pipe, which a file would replace.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        match fs::metadata(&target) {
            Ok(found) if found.is_dir() => return Err(WriteError::new(path, "it is a folder")),
            Ok(found) if !found.is_file() => return Err(WriteError::new(path, "it is no regular file")),
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(WriteError::io(path, &error)),
            _ => {}
        }
        let temporary = temporary_beside(&target);
        // Noted under the lock that the file is made under: there is none that is not noted.
        let mut unfinished = unfinished();
        let file = File::create_new(&temporary).map_err(|error| WriteError::io(path, &error))?;
        unfinished.push(temporary.clone());
        Ok(Self { path: path.to_owned(), target, temporary, writer: BufWriter::new(file) })
    }

    /// Writes what `content` writes.
    ///
    /// # Errors
    /// [`WriteError`] with the name and the reason, which is that of `content` too.
    pub fn write(&mut self, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
        content(&mut self.writer).map_err(|error| WriteError::io(&self.path, &error))
    }

    /// Gives the file its name, in the place of what had it before.
    ///
    /// # Errors
    /// [`WriteError`] with the name and the reason; what had the name before has it still.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let mut named = || {
            self.writer.flush()?;
            self.writer.get_ref().sync_all()?;
            let _unfinished = unfinished();
            fs::rename(&self.temporary, &self.target)
        };
        named().map_err(|error| WriteError::io(&self.path, &error))
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        let mut unfinished = unfinished();
        unfinished.retain(|file| *file != self.temporary);
        // Nothing of that name is left where the file was finished.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Writes `bytes` as the whole of a file.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    file.write(|out| out.write_all(bytes))?;
    file.finish()
}

/// A name in the folder of `path` that no other call uses, here or in another process.
fn temporary_beside(path: &Path) -> PathBuf {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    // Without the name of the file, which may be as long as the system allows.
    path.with_file_name(format!(".canted-{}-{}.tmp", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed)))
}

/// Why a file was not written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WriteError {
    path: PathBuf,
    reason: String,
}

impl WriteError {
    pub(super) fn new(path: &Path, reason: impl fmt::Display) -> Self {
        Self { path: path.to_owned(), reason: reason.to_string() }
    }

    /// The system's reason without its number.
    fn io(path: &Path, error: &io::Error) -> Self {
        let text = error.to_string();
        Self::new(path, text.split(" (os error").next().unwrap_or(&text).to_lowercase())
    }

    /// The file that was to be written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot write {}: {}", self.path.display(), self.reason)
    }
}

impl std::error::Error for WriteError {}

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
    fn devices_and_pipes_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let error = write_file(&path, b"").unwrap_err();
        assert_eq!(error.to_string(), format!("cannot write {}: it is no regular file", path.display()));
        assert!(!fs::metadata(&path).unwrap().is_file());
    }

    #[test]
    fn a_file_that_is_not_finished_leaves_nothing() {
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
    fn names_may_be_as_long_as_the_system_allows() {
        let folder = tempfile::tempdir().unwrap();
        write_file(&folder.path().join("x".repeat(255)), b"").unwrap();
    }

    #[test]
    fn new_files_are_as_readable_as_others() {
        let folder = tempfile::tempdir().unwrap();
        let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        fs::write(folder.path().join("other"), "").unwrap();
        write_file(&folder.path().join("ours"), b"").unwrap();
        assert_eq!(mode("ours"), mode("other"));
    }
}
