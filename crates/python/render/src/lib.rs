//! The Python package `canted_render`: the pictures of `canted render` as arrays.
//!
//! ```text
//! options, scene file or meshes -> canted_cli::picture -> film -> arrays
//! samples of these           -> canted_cli::picture_part -> film -> bytes -> merged -> arrays
//! ```
//!
//! Options have the names, values and defaults of the program, because they are parsed by it. Threads, errors and interrupts are those of
//! the package `canted`, whose files are shared. A panic becomes a `ValueError`.
#![forbid(unsafe_code)]

#[path = "../../src/error.rs"]
#[expect(dead_code, reason = "shared with the queries, which use more of it")]
mod error;
mod parts;
mod scene;
#[path = "../../src/threads.rs"]
mod threads;
#[path = "../../src/work.rs"]
#[expect(dead_code, reason = "shared with the queries, which use more of it")]
mod work;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use canted_cli::{Picture, Source, picture_part};
use canted_film::{AovValues, Aovs, Film, srgb};
use canted_renderer::Monitor;
use canted_scene::{ReadError, SceneFile};
use numpy::ndarray::Array3;
use numpy::{PyArray3, PyReadonlyArray1};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::error::{invalid, of_file};
use crate::scene::MeshArrays;
use crate::threads::Threads;

/// A scene that a render owns.
enum Scene {
    Builtin,
    File(PathBuf),
    InMemory(Box<SceneFile>),
}

/// What a render and its caller share.
#[derive(Default)]
struct Shared {
    n_done: AtomicUsize,
    n_tiles: AtomicUsize,
    cancel: AtomicBool,
}

/// Cancels the render when the call ends, whatever ends it.
struct CancelOnDrop(Arc<Shared>);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.cancel.store(true, Ordering::Relaxed);
    }
}

/// A picture of shape (h, w, 3), and its AOVs by name.
type Arrays<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyDict>);

/// What is rendered, as Python passes it.
struct Request<'a, 'py> {
    path: Option<PathBuf>,
    text: Option<&'a str>,
    meshes: Vec<MeshArrays<'py>>,
    options: Vec<(String, String)>,
    /// The first sample, and one past the last.
    part: Option<[u32; 2]>,
    threads: Option<i64>,
}

/// Renders a file, a scene file given as text with its meshes, or the built-in scene.
#[pyfunction]
#[pyo3(signature = (path, text, meshes, options, threads=None, progress=None))]
fn render<'py>(
    py: Python<'py>,
    path: Option<PathBuf>,
    text: Option<&str>,
    meshes: Vec<MeshArrays<'py>>,
    options: Vec<(String, String)>,
    threads: Option<i64>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Arrays<'py>> {
    let Picture { film, aovs, .. } =
        picture_of(py, Request { path, text, meshes, options, part: None, threads }, progress)?;
    arrays(py, &film, aovs)
}

/// Renders samples from `first` to before `last`: a part, for `merge_parts`.
#[pyfunction]
#[pyo3(signature = (path, text, meshes, options, first, last, threads=None))]
#[expect(clippy::too_many_arguments, reason = "those of render, and samples")]
fn render_part<'py>(
    py: Python<'py>,
    path: Option<PathBuf>,
    text: Option<&str>,
    meshes: Vec<MeshArrays<'py>>,
    options: Vec<(String, String)>,
    first: u32,
    last: u32,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyBytes>> {
    let part = Some([first, last]);
    let Picture { film, aovs, .. } = picture_of(py, Request { path, text, meshes, options, part, threads }, None)?;
    parts::to_bytes(py, &film, aovs)
}

fn picture_of<'py>(
    py: Python<'py>,
    request: Request<'_, 'py>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Picture> {
    let Request { path, text, meshes, options, part, threads } = request;
    let threads = Threads::new(threads)?;
    let scene = match (path, text) {
        (Some(path), _) => Scene::File(path),
        (None, Some(text)) => Scene::InMemory(Box::new(scene::file(text, &meshes)?)),
        (None, None) => Scene::Builtin,
    };
    drop(meshes);
    let shared = Arc::new(Shared::default());
    let of_call = CancelOnDrop(Arc::clone(&shared));
    let task = move || {
        let count = |done, all| {
            shared.n_tiles.store(all, Ordering::Relaxed);
            shared.n_done.store(done, Ordering::Relaxed);
        };
        let monitor = Monitor { progress: &count, ..Monitor::quiet(&shared.cancel) };
        let source = match &scene {
            Scene::Builtin => Source::Builtin,
            Scene::File(path) => Source::File(path),
            Scene::InMemory(file) => Source::SceneFile(file),
        };
        picture_part(&source, &options, part, &monitor)
    };
    let mut reported = 0.0;
    let mut report = |fraction: f64| {
        if let Some(progress) = progress.filter(|_| fraction > reported) {
            reported = fraction;
            progress.call1((fraction,))?;
        }
        Ok(())
    };
    let rendered = work::run_watched(py, &threads, task, |_| {
        let [n_done, n_tiles] = [&of_call.0.n_done, &of_call.0.n_tiles].map(|n| n.load(Ordering::Relaxed));
        // The end is reported once, by the caller below.
        report(if n_done < n_tiles { ratio(n_done, n_tiles) } else { 0.0 })
    })?;
    let picture = rendered.map_err(|error| of_render(&error))?;
    report(1.0)?;
    for warning in &picture.warnings {
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &std::ffi::CString::new(warning.as_str())?, 2)?;
    }
    Ok(picture)
}

/// The pixels of a film, and its AOVs by name.
fn arrays<'py>(py: Python<'py>, film: &Film, aovs: Aovs) -> PyResult<Arrays<'py>> {
    let by_name = PyDict::new(py);
    for aov in aovs.iter() {
        let Some(values) = film.aov(aov) else { continue };
        let n = aov.channels().len();
        match values {
            AovValues::Numbers(numbers) => by_name.set_item(aov.name(), array(py, film, n, numbers)?)?,
            // No hit is -1, as in the hits of queries.
            AovValues::Ids(ids) => {
                let ids = ids.into_iter().map(u32::cast_signed).collect();
                by_name.set_item(aov.name(), array(py, film, n, ids)?)?;
            }
        }
    }
    // Adding zero makes -0 positive, as in files.
    let pixels = film.picture().pixels.into_iter().flatten().map(|x| x + 0.0).collect();
    Ok((array(py, film, 3, pixels)?, by_name))
}

fn ratio(n_done: usize, n_tiles: usize) -> f64 {
    n_done as f64 / n_tiles as f64
}

/// Values of all pixels as an array of shape (h, w, n).
fn array<'py, T: numpy::Element>(
    py: Python<'py>,
    film: &Film,
    n: usize,
    values: Vec<T>,
) -> PyResult<Bound<'py, PyArray3<T>>> {
    let shape = (film.height() as usize, film.width() as usize, n);
    let array = Array3::from_shape_vec(shape, values).map_err(invalid)?;
    Ok(PyArray3::from_owned_array(py, array))
}

/// The error of a render: `OSError` for a file that cannot be read, else `ValueError`.
fn of_render(error: &anyhow::Error) -> PyErr {
    match error.downcast_ref() {
        Some(ReadError::Io { path, source }) => of_file(path, source),
        _ => invalid(error),
    }
}

/// Linear numbers as bytes of sRGB, as the program writes them into PNG files.
#[pyfunction]
fn srgb_bytes<'py>(py: Python<'py>, linear: PyReadonlyArray1<'py, f32>) -> Bound<'py, PyBytes> {
    let bytes: Vec<u8> = linear.as_array().iter().map(|&x| srgb::encode(x)).collect();
    PyBytes::new(py, &bytes)
}

/// The compiled part of `canted_render`.
#[pymodule(gil_used = true)]
fn _canted_render(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(render, module)?)?;
    module.add_function(wrap_pyfunction!(render_part, module)?)?;
    module.add_function(wrap_pyfunction!(parts::merge_parts, module)?)?;
    module.add_function(wrap_pyfunction!(parts::read_part, module)?)?;
    module.add_function(wrap_pyfunction!(srgb_bytes, module)?)
}
