//! Standard output and error, and checks of output files.

use std::{
    cell::RefCell,
    fs,
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU8, AtomicUsize, Ordering},
};

use anyhow::{Result, anyhow};
use canted_film::{AtomicFile, FileError};

/// How much is printed beside results and errors.
static VERBOSITY: AtomicU8 = AtomicU8::new(NORMAL);
const QUIET: u8 = 0;
const NORMAL: u8 = 1;
const VERBOSE: u8 = 2;

/// Sets what `-q` and `-v` choose.
pub(crate) fn set_verbosity(quiet: bool, verbose: bool) {
    let verbosity = if quiet { QUIET } else { NORMAL + u8::from(verbose) };
    VERBOSITY.store(verbosity, Ordering::Relaxed);
}

/// Whether only results and errors are printed.
pub(crate) fn is_quiet() -> bool {
    VERBOSITY.load(Ordering::Relaxed) == QUIET
}

/// Whether each stage is printed.
pub(crate) fn is_verbose() -> bool {
    VERBOSITY.load(Ordering::Relaxed) == VERBOSE
}

/// Writes a line to standard output. A closed pipe is not an error: the reader may stop early.
///
/// # Errors
/// Any other failure, such as a full disk.
pub(crate) fn to_stdout(text: &str) -> Result<()> {
    bytes_to_stdout(format!("{text}\n").as_bytes())
}

/// Writes bytes to standard output, as [`to_stdout`].
///
/// # Errors
/// Any failure but a closed pipe.
pub(crate) fn bytes_to_stdout(bytes: &[u8]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(anyhow!("cannot write standard output: {error}")),
        _ => Ok(()),
    }
}

/// Writes a line to standard error.
pub(crate) fn to_stderr(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

thread_local! {
    /// Warnings and notes of this thread since [`collecting`] began.
    static COLLECTED: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Whether a sentence was collected instead of being written.
fn is_collected(text: &str) -> bool {
    COLLECTED.with_borrow_mut(|all| all.as_mut().map(|all| all.push(text.to_owned())).is_some())
}

/// Number of warnings written.
static N_WARNINGS: AtomicUsize = AtomicUsize::new(0);

/// The number of warnings that were written to standard error.
pub(crate) fn n_warnings() -> usize {
    N_WARNINGS.load(Ordering::Relaxed)
}

/// Writes a warning to standard error, unless `-q` is given, or collects it.
pub(crate) fn warn(text: &str) {
    if !is_collected(text) && !is_quiet() {
        N_WARNINGS.fetch_add(1, Ordering::Relaxed);
        to_stderr(&format!("warning: {text}"));
    }
}

/// Writes a note about what was decided to standard error, unless `-q` is given, or collects it.
pub(crate) fn note(text: &str) {
    if !is_collected(text) && !is_quiet() {
        to_stderr(&format!("note: {text}"));
    }
}

/// Number of notes of skipped elements written.
static N_SKIPPED: AtomicUsize = AtomicUsize::new(0);

/// The number of notes of [`skipped`] elements that were written to standard error.
pub(crate) fn n_skipped() -> usize {
    N_SKIPPED.load(Ordering::Relaxed)
}

/// Writes a note about elements of a file that are not drawn, as [`note`].
pub(crate) fn skipped(text: &str) {
    if !is_collected(text) && !is_quiet() {
        N_SKIPPED.fetch_add(1, Ordering::Relaxed);
        to_stderr(&format!("note: {text}"));
    }
}

/// Writes a note about a stage to standard error if `-v` is given.
pub(crate) fn detail(text: impl FnOnce() -> String) {
    if is_verbose() {
        to_stderr(&format!("detail: {}", text()));
    }
}

/// Runs a function and returns its warnings and notes instead of writing them.
pub(crate) fn collecting<R>(run: impl FnOnce() -> R) -> (R, Vec<String>) {
    // A thread that waits for others may take up another picture in between.
    let outer = COLLECTED.replace(Some(Vec::new()));
    let result = run();
    (result, COLLECTED.replace(outer).unwrap_or_default())
}

/// Fails if a file cannot be written, before any work is done. Leaves no file behind.
pub(crate) fn probe(path: &Path) -> Result<(), FileError> {
    AtomicFile::create(path).map(drop)
}

/// Whether a file name has this extension, in lower or upper case.
pub(crate) fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// The error for a file name whose extension is not one of those in `supported`.
pub(crate) fn unsupported(path: &Path, supported: &str) -> anyhow::Error {
    let extension = path.extension().map(|own| format!(" '.{}'", own.display())).unwrap_or_default();
    anyhow!("{}: unsupported format{extension}; use {supported}", path.display())
}

/// A file and its name on the command line.
pub(crate) type Named<'a> = (&'a str, &'a Path);

/// Rejects outputs that would replace an input or each other, even where different paths lead to the same file.
pub(crate) fn check_distinct(inputs: &[Named], outputs: &[Named]) -> Result<()> {
    let mut used: Vec<(&str, PathBuf)> = inputs.iter().map(|&(name, path)| (name, resolved(path))).collect();
    for &(name, path) in outputs {
        let file = resolved(path);
        if let Some((earlier, _)) = used.iter().find(|(_, other)| *other == file) {
            return Err(anyhow!("{earlier} and {name} are the same file, {}; use another output file", path.display()));
        }
        used.push((name, file));
    }
    Ok(())
}

/// The file that a path leads to, whether it exists or not.
fn resolved(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let in_folder = || Some(fs::canonicalize(folder).ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}
