//! A mesh with its BVH, and what builds and refits do to it.

use std::fmt;
use std::sync::{Arc, OnceLock, PoisonError, RwLock};

use canted::build::Refit;
use canted::distance::WindingNumbers;
use canted::{Config, Preset, PrimId, TriangleBvh};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, NO_ORIGIN, Table};
use crate::error::{filled, invalid};
use crate::frame::{self, Near, Origin};
use crate::names::Inside;
use crate::work::Call;

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
    /// Whether that was chosen near the mesh: rays then start near it, and results are `float64`.
    pub(crate) is_near: bool,
    /// None in a file of the Rust library.
    pub(crate) preset: Option<Preset>,
    /// Prepared when they are first asked for.
    pub(crate) winding: Arc<OnceLock<WindingNumbers>>,
}

/// Builds a BVH, without Python's global lock, of copies of the arrays.
pub(crate) fn build(
    call: &Call<'_>,
    config: Config,
    preset: Preset,
    (vertices, triangles): (&Bound<'_, PyAny>, &Bound<'_, PyAny>),
    origin: Origin,
) -> PyResult<Geometry> {
    let vertices = Table::new(vertices, "vertices")?;
    let n_vertices = vertices.len();
    let triangles = Arc::new(arrays::triangles(triangles, n_vertices)?);
    let exact = match origin {
        Origin::At(_) => None,
        Origin::Auto if vertices.is_f32() => None,
        Origin::Auto | Origin::Near => Some(vertices.rows(NO_ORIGIN).all_exact()?),
    };
    let is_harmful = |exact: &Vec<[f64; 3]>| frame::is_rounding_harmful(exact, &triangles);
    let exact = exact.filter(|exact| origin == Origin::Near || is_harmful(exact));
    let (is_near, origin) = match (&exact, origin) {
        (Some(exact), _) => (true, frame::origin_of(exact.iter().copied())),
        (None, Origin::At(origin)) => (false, origin),
        (None, _) => (false, NO_ORIGIN),
    };
    // Once more, so another thread may have changed them; the build checks these.
    let positions = vertices.rows(origin).all()?;
    let build = {
        let triangles = Arc::clone(&triangles);
        move || TriangleBvh::build_with(&positions, &triangles, config)
    };
    call.report(0.0)?;
    let built = if triangles.len() < LONG { call.run_short(build)? } else { call.run(build)? };
    let mesh = Arc::new(built.map_err(invalid)?);
    call.report(1.0)?;
    let (triangles, preset, winding) = (Some(triangles), Some(preset), Arc::default());
    Ok(Geometry { mesh, triangles, n_vertices, origin, is_near, preset, winding })
}

/// Moves the vertices, without Python's global lock, to a copy of the array.
pub(crate) fn refit(call: &Call<'_>, place: &RwLock<Arc<Geometry>>, vertices: &Bound<'_, PyAny>) -> PyResult<Refit> {
    let old = Arc::clone(&place.read().unwrap_or_else(PoisonError::into_inner));
    let (n_vertices, n_triangles) = (old.n_vertices, old.mesh.n_primitives());
    let Some(triangles) = old.triangles.clone() else {
        return Err(invalid("a BVH from a file of the Rust library has no vertex indices, so it cannot be refitted"));
    };
    let vertices = Table::new(vertices, "vertices")?;
    if vertices.len() != n_vertices {
        let n_given = vertices.len();
        return Err(invalid(format!("the BVH was built over {n_vertices} vertices, but {n_given} are given")));
    }
    let positions = vertices.rows(old.origin).all()?;
    let refit = if n_triangles < LONG {
        // In place, unless hits or a TLAS refer to the old mesh.
        drop(old);
        call.run_short(|| {
            let mut place = place.write().unwrap_or_else(PoisonError::into_inner);
            let geometry = Arc::make_mut(&mut place);
            geometry.winding = Arc::default();
            Arc::make_mut(&mut geometry.mesh).refit(&positions, &triangles)
        })?
    } else {
        // On a copy, so that the BVH is unchanged after an interrupt.
        let mut new = (*old).clone();
        new.winding = Arc::default();
        drop(old);
        let (new, refit) = call.run(move || {
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

/// What inside means in a call. The default is the winding number, or parity where it says little because neighbors disagree in orientation.
pub(crate) fn inside(call: &Call<'_>, geometry: &Arc<Geometry>, mode: Option<Inside>) -> PyResult<Inside> {
    if mode == Some(Inside::Parity) {
        return Ok(Inside::Parity);
    }
    if geometry.winding.get().is_none() {
        let of_task = Arc::clone(geometry);
        call.run(move || {
            of_task.winding();
        })?;
    }
    let is_oriented = geometry.winding().is_oriented();
    Ok(mode.unwrap_or(if is_oriented { Inside::Winding } else { Inside::Parity }))
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

    /// The winding numbers of the mesh, of which the first call prepares clusters.
    pub(crate) fn winding(&self) -> &WindingNumbers {
        self.winding.get_or_init(|| self.mesh.winding_numbers())
    }

    /// The sphere where rays start.
    pub(crate) fn near(&self) -> Option<Near> {
        (self.is_near && self.mesh.n_primitives() > 0).then(|| Near::new(&self.mesh.aabb()))
    }

    /// A vertex in the space of the caller.
    fn given(&self, vertex: [f32; 3]) -> [f64; 3] {
        std::array::from_fn(|k| f64::from(vertex[k]) + self.origin[k])
    }

    /// Least and greatest coordinates, in the space of the caller; none of an empty mesh.
    pub(crate) fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let aabb = self.mesh.aabb();
        (self.mesh.n_primitives() > 0).then(|| [aabb.min, aabb.max].map(|end| self.given(end)))
    }

    /// The indices of the build; without them, three vertices for each triangle.
    pub(crate) fn triangles(&self) -> Vec<[u32; 3]> {
        let n = u32::try_from(self.mesh.n_primitives()).unwrap_or(u32::MAX);
        self.triangles
            .as_ref()
            .map_or_else(|| (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), |all| all.to_vec())
    }

    /// The vertices in the space of the caller; NaN for those that no triangle has.
    pub(crate) fn vertices(&self) -> PyResult<Vec<[f64; 3]>> {
        let triangles = self.triangles();
        let n = if self.triangles.is_some() { self.n_vertices } else { 3 * triangles.len() };
        let mut vertices = filled(n, [f64::NAN; 3])?;
        for (id, triangle) in (0..).zip(&triangles) {
            for (&index, vertex) in triangle.iter().zip(self.mesh.triangle(PrimId(id))) {
                vertices[index as usize] = self.given(vertex);
            }
        }
        Ok(vertices)
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
