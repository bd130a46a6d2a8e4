//! The Python package `canted`: BVHs over triangle meshes, ray and distance queries on NumPy arrays.
//!
//! ```text
//! arrays -> rows, columns -> jobs of rays -> threads -> columns -> arrays
//! ```
//!
//! | file | purpose |
//! | --- | --- |
//! | `arrays` | NumPy arrays of any layout as rows of three numbers, columns, indices |
//! | `threads`, `work` | thread pools; jobs that Ctrl-C interrupts and that report their progress |
//! | `query`, `overlaps` | queries of slices of rays; of regions |
//! | `geometry`, `frame` | builds and refits; origins near a mesh |
//! | `bvh`, `tlas`, `tiles`, `hits`, `nearest` | the classes of the package |
//! | `bodies` | meshes against meshes, and spheres that move |
//! | `distributed` | BVHs that workers of Dask get |
//! | `points` | positions and normals of hits |
//! | `file` | BVHs as files |
//!
//! Every query is one of the Rust library, ray by ray, so its answers are those of Rust bit for bit. Python's global lock is
//! released during builds and queries. A panic becomes a `ValueError`.
#![forbid(unsafe_code)]

mod arrays;
mod bodies;
mod bvh;
mod distributed;
mod error;
mod file;
mod frame;
mod geometry;
mod hits;
mod names;
mod nearest;
mod overlaps;
mod points;
mod query;
mod threads;
mod tiles;
mod tlas;
mod work;

use pyo3::prelude::*;

/// The compiled part of `canted`.
#[pymodule(gil_used = true)]
fn _canted(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(distributed::with_simd, module)?)?;
    module.add_function(wrap_pyfunction!(distributed::snapshot, module)?)?;
    module.add_function(wrap_pyfunction!(distributed::is_same, module)?)?;
    module.add_class::<bvh::Bvh>()?;
    module.add_class::<tlas::Tlas>()?;
    module.add_class::<tiles::Tiles>()?;
    module.add_class::<hits::Hits>()?;
    module.add_class::<nearest::Nearest>()?;
    module.add_class::<bodies::Contact>()?;
    module.add_class::<bodies::Distance>()
}
