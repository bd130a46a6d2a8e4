//! A mesh with its BVH, and what builds and refits do to it.

use std::borrow::Cow;
use std::fmt;
use std::sync::{Arc, PoisonError, RwLock};

use canted::build::Refit;
use canted::{Config, Preset, TriangleBvh};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Table};
use crate::error::{guard, invalid};
use crate::threads::Threads;
use crate::work;

/// More triangles than this are built and refitted on a thread of their own, so that Ctrl-C abandons them: fewer take well
/// below 0.2 s.
const LONG: usize = 1 << 16;

/// A mesh and its BVH.
#[derive(Clone)]
pub(crate) struct Geometry {
    pub(crate) mesh: Arc<TriangleBvh>,
    /// The indices of the build, which a refit needs; none in a file of the Rust library.
    pub(crate) triangles: Option<Arc<Vec<[u32; 3]>>>,
    pub(crate) n_vertices: usize,
    /// What is subtracted from coordinates of the caller.
    pub(crate) origin: [f64; 3],
    /// None in a file of the Rust library.
    pub(crate) preset: Option<Preset>,
}

/// Builds a BVH, without Python's global lock.
pub(crate) fn build(
    py: Python<'_>,
    threads: &Threads,
    config: Config,
    positions: Cow<'_, [[f32; 3]]>,
    triangles: &Arc<Vec<[u32; 3]>>,
) -> PyResult<TriangleBvh> {
    let built = if triangles.len() < LONG {
        let build = || TriangleBvh::build_with(&positions, triangles, config);
        py.detach(|| guard(|| threads.run(build)))?
    } else {
        let (positions, triangles) = (positions.into_owned(), Arc::clone(triangles));
        work::run(py, threads, move || TriangleBvh::build_with(&positions, &triangles, config))?
    };
    built.map_err(invalid)
}

/// Moves the vertices, without Python's global lock.
pub(crate) fn refit(
    py: Python<'_>,
    threads: &Threads,
    place: &RwLock<Arc<Geometry>>,
    vertices: &Bound<'_, PyAny>,
) -> PyResult<Refit> {
    let old = Arc::clone(&place.read().unwrap_or_else(PoisonError::into_inner));
    let (n_vertices, n_triangles) = (old.n_vertices, old.mesh.n_primitives());
    let Some(triangles) = old.triangles.clone() else {
        return Err(invalid("a BVH from a file of the Rust library has no vertex indices, so it cannot be refitted"));
    };
    let vertices = Table::new(vertices, "vertices", false)?;
    if vertices.len() != n_vertices {
        let n_given = vertices.len();
        return Err(invalid(format!("the BVH was built over {n_vertices} vertices, but {n_given} are given")));
    }
    let positions = vertices.rows(old.origin).all()?;
    let refit = if n_triangles < LONG {
        // In place, unless hits or a TLAS refer to the old mesh.
        drop(old);
        let refit = || {
            let mut geometry = place.write().unwrap_or_else(PoisonError::into_inner);
            Arc::make_mut(&mut Arc::make_mut(&mut geometry).mesh).refit(&positions, &triangles)
        };
        py.detach(|| guard(|| threads.run(refit)))?
    } else {
        // On a copy, so that the BVH is unchanged after an interrupt.
        let (mut new, positions) = ((*old).clone(), positions.into_owned());
        drop(old);
        let (new, refit) = work::run(py, threads, move || {
            let refit = Arc::make_mut(&mut new.mesh).refit(&positions, &triangles);
            (new, refit)
        })?;
        if refit.is_ok() {
            *place.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(new);
        }
        refit
    };
    refit.map_err(invalid)
}

/// What a refit returns to Python.
pub(crate) fn report<'py>(py: Python<'py>, refit: &Refit) -> PyResult<Bound<'py, PyDict>> {
    let report = PyDict::new(py);
    report.set_item("cost_built", refit.cost_built)?;
    report.set_item("cost_before", refit.cost_before)?;
    report.set_item("cost_now", refit.cost_now)?;
    report.set_item("drift", refit.drift)?;
    report.set_item("rebuild_advised", refit.rebuild_advised())?;
    Ok(report)
}

impl Geometry {
    /// The origin of a query: its own, or that of the build.
    pub(crate) fn origin(&self, argument: Option<&Bound<'_, PyAny>>) -> PyResult<[f64; 3]> {
        Ok(arrays::origin(argument)?.unwrap_or(self.origin))
    }

    /// Least and greatest coordinates, in the space of the caller.
    pub(crate) fn bounds(&self) -> [[f64; 3]; 2] {
        let aabb = self.mesh.aabb();
        [aabb.min, aabb.max].map(|end| std::array::from_fn(|k| f64::from(end[k]) + self.origin[k]))
    }

    fn n_bytes(&self) -> usize {
        let sizes = self.mesh.sizes();
        sizes.node_bytes + sizes.leaf_bytes
    }

    /// What `Bvh.stats` returns.
    pub(crate) fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (sizes, predicted) = (self.mesh.sizes(), self.mesh.predicted());
        let stats = PyDict::new(py);
        stats.set_item("triangles", self.mesh.n_primitives())?;
        stats.set_item("vertices", self.n_vertices)?;
        stats.set_item("bytes", self.n_bytes())?;
        stats.set_item("node_bytes", sizes.node_bytes)?;
        stats.set_item("leaf_bytes", sizes.leaf_bytes)?;
        stats.set_item("aligned_nodes", sizes.nodes[0])?;
        stats.set_item("oriented_nodes", sizes.nodes[1])?;
        stats.set_item("depth", sizes.depth)?;
        stats.set_item("predicted_cost", predicted.chosen)?;
        stats.set_item("predicted_cost_aligned", predicted.aligned)?;
        stats.set_item("preset", self.preset.map(Preset::name))?;
        stats.set_item("triangle_test", self.mesh.test().name())?;
        stats.set_item("simd", format!("{:?}", self.mesh.path()).to_lowercase())?;
        stats.set_item("origin", (self.origin[0], self.origin[1], self.origin[2]))?;
        Ok(stats)
    }
}

impl fmt::Display for Geometry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [aligned, oriented] = self.mesh.sizes().nodes;
        let (n, kib) = (self.mesh.n_primitives(), self.n_bytes().div_ceil(1024));
        write!(f, "Bvh({n} triangles, {aligned} aligned and {oriented} oriented nodes, {kib} KiB)")
    }
}
