//! Errors as Python shows them.

use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyOSError, PyValueError};
use pyo3::prelude::*;

/// A `ValueError` with this sentence.
pub(crate) fn invalid(sentence: impl Display) -> PyErr {
    PyValueError::new_err(sentence.to_string())
}

/// The `OSError` of a file operation, of the subclass that Python has for it, such as `FileNotFoundError`.
pub(crate) fn of_file(path: &Path, error: &std::io::Error) -> PyErr {
    let name = path.display().to_string();
    match error.raw_os_error() {
        Some(number) => PyOSError::new_err((number, error.to_string(), name)),
        None => PyOSError::new_err(format!("{name}: {error}")),
    }
}

/// An error of NumPy about an argument, with our sentence; interrupts and lack of memory stay what they are.
pub(crate) fn of_argument(py: Python<'_>, name: &str, error: PyErr) -> PyErr {
    if error.is_instance_of::<PyKeyboardInterrupt>(py) || error.is_instance_of::<PyMemoryError>(py) {
        return error;
    }
    invalid(format!("{name} cannot be converted to an array: {}", error.value(py)))
}

/// The result of `run`; a panic becomes an error.
///
/// What `run` changes is dropped after a panic by all callers.
pub(crate) fn guard<T>(run: impl FnOnce() -> T) -> Result<T, Panic> {
    catch_unwind(AssertUnwindSafe(run)).map_err(|panic| Panic::of(&*panic))
}

/// The message of a panic.
#[derive(Clone, Debug)]
pub(crate) struct Panic(String);

impl Panic {
    fn of(panic: &(dyn Any + Send)) -> Self {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        Self(text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default())
    }
}

impl From<Panic> for PyErr {
    fn from(Panic(message): Panic) -> Self {
        invalid(format!("canted has a defect, please report it: {message}"))
    }
}

/// `n` copies of a value, or `MemoryError`.
pub(crate) fn filled<T: Clone>(n: usize, value: T) -> PyResult<Vec<T>> {
    let mut values = reserved(n)?;
    values.resize(n, value);
    Ok(values)
}

/// An empty vector with room for `n` values, or `MemoryError`.
pub(crate) fn reserved<T>(n: usize) -> PyResult<Vec<T>> {
    let mut values = Vec::new();
    match values.try_reserve_exact(n) {
        Ok(()) => Ok(values),
        Err(_) => Err(PyMemoryError::new_err(format!("not enough memory for {n} results"))),
    }
}
