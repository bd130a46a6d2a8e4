//! Parts of pictures as bytes: those of the EXR files of `canted render --samples`.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use canted_film::{Aovs, Film, Part, write_film};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::{invalid, of_file};
use crate::{Arrays, arrays};

/// A file in the folder of temporary files, removed on drop: films are read from files.
struct Temporary(PathBuf);

impl Temporary {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let (process, number) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        Self(std::env::temp_dir().join(format!("canted-part-{process}-{number}.exr")))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// A film with its exact sums.
pub(crate) fn to_bytes<'py>(py: Python<'py>, film: &Film, aovs: Aovs) -> PyResult<Bound<'py, PyBytes>> {
    let file = Temporary::new();
    let bytes = py.detach(|| {
        write_film(&file.0, film, aovs, &[]).map_err(invalid)?;
        fs::read(&file.0).map_err(|error| of_file(&file.0, &error))
    })?;
    Ok(PyBytes::new(py, &bytes))
}

fn of_bytes(bytes: &[u8]) -> PyResult<(Film, Aovs)> {
    let file = Temporary::new();
    fs::write(&file.0, bytes).map_err(|error| of_file(&file.0, &error))?;
    let (film, aovs, _) = canted_film::read_part(&file.0).map_err(invalid)?;
    Ok((film, aovs))
}

/// Joins parts of one picture, in any order, to a larger part.
#[pyfunction]
pub(crate) fn merge_parts<'py>(py: Python<'py>, parts: Vec<Vec<u8>>) -> PyResult<Bound<'py, PyBytes>> {
    let (film, aovs) = py.detach(|| {
        let films = parts.iter().map(|bytes| of_bytes(bytes)).collect::<PyResult<Vec<_>>>()?;
        let Some(&(ref first, aovs)) = films.first() else { return Err(invalid("there are no parts")) };
        let (width, height) = (first.width(), first.height());
        if films.iter().any(|(film, own)| [film.width(), film.height()] != [width, height] || *own != aovs) {
            return Err(invalid("the parts are of different pictures: sizes or AOVs differ"));
        }
        let own: Vec<Part> = films.iter().filter_map(|(film, _)| film.part().cloned()).collect();
        let joined = Part::join(own).map_err(invalid)?;
        Ok((Film::of_part(width, height, joined, 0), aovs))
    })?;
    to_bytes(py, &film, aovs)
}

/// The pixels of a part, and its AOVs by name.
#[pyfunction]
pub(crate) fn read_part<'py>(py: Python<'py>, bytes: Vec<u8>) -> PyResult<Arrays<'py>> {
    let (film, aovs) = py.detach(|| of_bytes(&bytes))?;
    arrays(py, &film, aovs)
}
