use std::path::PathBuf;
use std::sync::{Arc, PoisonError, RwLock};

use canted::kernel::HitLists;
use canted::{Config, Crossings, Intersect, Ray, TriangleTest};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyType};

use crate::arrays::{self, NO_ORIGIN, Table};
use crate::error::invalid;
use crate::file;
use crate::geometry::{self, Geometry};
use crate::hits::Hits;
use crate::names;
use crate::nearest::{self, Nearest};
use crate::points::{Surface, table};
use crate::query::{RayArrays, all_hits, closest_hits, occluded};
use crate::threads::Threads;
use crate::work;

/// A bounding volume hierarchy over a triangle mesh: ray, containment and distance queries.
///
/// Every answer is that of a loop over all triangles: no hit is lost at edges and vertices, and there is no epsilon.
///
/// Parameters
/// ----------
/// vertices : (n, 3) float32 or float64
///     Finite coordinates. Triangles use float32: float64 is rounded once, to nearest, after origin is subtracted.
/// triangles : (m, 3) integers
///     Vertex indices from 0.
/// preset : "dynamic", "fast", "balanced" or "quality"
///     How much build time is spent on how fast a BVH. Answers do not depend on it.
/// triangle_test : "watertight", "moller-trumbore" or "baldwin-weber"
///     Only watertight has no leaks between triangles, and crossings.
/// aligned : bool
///     Builds without oriented nodes, to compare. Answers do not depend on it.
/// origin : (3,) floats, optional
///     Subtracted in float64 from vertices, and from origins and points of queries; added to positions of results. Use a point near the mesh
///     where coordinates are large.
/// threads : int, optional
///     Threads of the build, 1 to 1024. Default: all processors.
///
/// Raises
/// ------
/// ValueError
///     Wrong shapes or types; the first triangle with an index out of range or a vertex that is not finite.
#[pyclass(frozen, module = "canted")]
pub(crate) struct Bvh {
    geometry: RwLock<Arc<Geometry>>,
}

impl Bvh {
    /// The mesh as it is now.
    pub(crate) fn geometry(&self) -> Arc<Geometry> {
        self.geometry.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(crate) fn of(geometry: Geometry) -> Self {
        Self { geometry: RwLock::new(Arc::new(geometry)) }
    }
}

/// The arguments of ray queries, as Python passes them.
struct RayCall<'a, 'py> {
    origins: &'a Bound<'py, PyAny>,
    directions: &'a Bound<'py, PyAny>,
    interval: [Option<&'a Bound<'py, PyAny>>; 2],
    origin: Option<&'a Bound<'py, PyAny>>,
    threads: Option<i64>,
}

impl Bvh {
    /// All hits, or the crossings.
    fn list(&self, py: Python<'_>, call: &RayCall<'_, '_>, only_crossings: bool) -> PyResult<Hits> {
        let (geometry, threads) = (self.geometry(), Threads::new(call.threads)?);
        let origin = geometry.origin(call.origin)?;
        let arrays = RayArrays::new(call.origins, call.directions, call.interval)?;
        let rays = arrays.rays(origin);
        let mesh = &*geometry.mesh;
        if only_crossings && mesh.test() != TriangleTest::Watertight {
            let test = mesh.test();
            return Err(invalid(format!("crossings need triangle_test='watertight'; this BVH has '{test}'")));
        }
        let list = |rays: &[Ray], lists: &mut HitLists| match only_crossings {
            true => mesh.crossings_listed(rays, lists),
            false => mesh.all_hits_listed(rays, lists),
        };
        let columns = all_hits(py, &threads, &list, &rays, false)?;
        Ok(Hits::new(py, columns, Surface::Mesh { geometry, origin }, rays.len()))
    }
}

#[pymethods]
impl Bvh {
    #[new]
    #[pyo3(signature = (vertices, triangles, preset="balanced", triangle_test="watertight", *, aligned=false, origin=None, threads=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn new(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        preset: &str,
        triangle_test: &str,
        aligned: bool,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Self> {
        let (preset, test) = (names::preset(preset)?, names::triangle_test(triangle_test)?);
        let config = Config { test, ..Config::preset(preset) };
        let config = if aligned { config.axis_aligned() } else { config };
        let threads = Threads::new(threads)?;
        let origin = arrays::origin(origin)?.unwrap_or(NO_ORIGIN);
        let vertices = Table::new(vertices, "vertices", false)?;
        let positions = vertices.rows(origin).all()?;
        let n_vertices = positions.len();
        let triangles = Arc::new(arrays::triangles(triangles, n_vertices)?);
        let mesh = Arc::new(geometry::build(py, &threads, config, positions, &triangles)?);
        let triangles = Some(triangles);
        Ok(Self::of(Geometry { mesh, triangles, n_vertices, origin, preset: Some(preset) }))
    }

    /// closest_hit(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None)
    ///
    /// The first hit of each ray.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : (n, 3) or (3,) floats
    ///     Arrays of n rays, or one ray, which counts as n = 1; one origin or direction of shape (3,) serves all. Directions may have
    ///     any length but zero. float64 is rounded to float32, origins after the BVH's origin is subtracted.
    /// t_min, t_max : float or (n,) floats
    ///     The closed interval of t, in units of the direction.
    /// origin : (3,) floats, optional
    ///     Subtracted from origins in float64. Default: that of the BVH.
    /// threads : int, optional
    ///     1 to 1024. Default: all processors.
    ///
    /// Returns
    /// -------
    /// Hits
    ///     One row for each ray. A ray with a NaN, an infinite origin or direction, a zero direction, a negative t_min or
    ///     an empty interval never hits. Of equal t the lowest triangle is reported.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Wrong shapes or types, or different numbers of origins and directions.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn closest_hit(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Hits> {
        let (geometry, threads) = (self.geometry(), Threads::new(threads)?);
        let origin = geometry.origin(origin)?;
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let rays = arrays.rays(origin);
        let columns = closest_hits(py, &threads, &*geometry.mesh, &rays, false)?;
        Ok(Hits::new(py, columns, Surface::Mesh { geometry, origin }, rays.len()))
    }

    /// occluded(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None)
    ///
    /// Whether each ray hits anything: (n,) bool. Agrees with closest_hit, whose parameters and errors it has, and is faster.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn occluded(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Py<PyArray1<bool>>> {
        let (geometry, threads) = (self.geometry(), Threads::new(threads)?);
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let found = occluded(py, &threads, &*geometry.mesh, &arrays.rays(geometry.origin(origin)?))?;
        Ok(PyArray1::from_vec(py, found).unbind())
    }

    /// all_hits(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None)
    ///
    /// Every hit of every ray: Hits with one row for each hit, in order of ray, then t, then triangle.
    ///
    /// Each triangle appears once for a ray, and all triangles around an edge or a vertex that a ray passes through appear;
    /// crossings counts surfaces instead. Parameters and errors are those of closest_hit.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn all_hits(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Hits> {
        let call = RayCall { origins, directions, interval: [t_min, t_max], origin, threads };
        self.list(py, &call, false)
    }

    /// crossings(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None)
    ///
    /// Every crossing of a surface once, also through edges and vertices: Hits in the order of all_hits.
    ///
    /// entering says whether a ray enters a solid, whose triangles run counter-clockwise as seen from outside. A ray that starts
    /// and ends outside of a closed mesh enters it as often as it leaves. Where a ray touches a silhouette without crossing,
    /// nothing is reported. Parameters are those of closest_hit.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As closest_hit, and for a BVH with another triangle test than "watertight".
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn crossings(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Hits> {
        let call = RayCall { origins, directions, interval: [t_min, t_max], origin, threads };
        self.list(py, &call, true)
    }

    /// contains(points, *, origin=None, threads=None)
    ///
    /// Whether each point is inside of a closed mesh or on its surface: (n,) bool.
    ///
    /// Exact for every finite point of float32. Nested surfaces alternate: a hole in a solid is outside. The orientation of
    /// triangles does not matter. For a mesh that is not closed it is the parity of the crossings above the point.
    ///
    /// Parameters
    /// ----------
    /// points : (n, 3) or (3,) floats
    ///     float64 is rounded to float32 after origin is subtracted.
    #[pyo3(signature = (points, *, origin=None, threads=None))]
    fn contains(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Py<PyArray1<bool>>> {
        let (geometry, threads) = (self.geometry(), Threads::new(threads)?);
        let (points, origin) = (Table::new(points, "points", true)?, geometry.origin(origin)?);
        let inside = nearest::of_points(py, &threads, &points.rows(origin), false, |points, inside| {
            geometry.mesh.contains_many(points, inside);
        })?;
        Ok(PyArray1::from_vec(py, inside).unbind())
    }

    /// nearest(points, max_distance=inf, *, origin=None, threads=None)
    ///
    /// The nearest point of the mesh to each point: Nearest.
    ///
    /// Parameters
    /// ----------
    /// points : (n, 3) or (3,) floats
    ///     float64 is rounded to float32 after origin is subtracted.
    /// max_distance : float
    ///     Triangles farther away are not found; nothing is found for a negative one.
    #[pyo3(signature = (points, max_distance=f64::INFINITY, *, origin=None, threads=None))]
    fn nearest(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        max_distance: f64,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Nearest> {
        let (geometry, threads) = (self.geometry(), Threads::new(threads)?);
        let (points, origin) = (Table::new(points, "points", true)?, geometry.origin(origin)?);
        nearest::nearest(py, &threads, &geometry.mesh, &points, origin, max_distance)
    }

    /// signed_distance(points, *, origin=None, threads=None)
    ///
    /// Distance of each point to the surface of a closed mesh, (n,) float32: negative inside, zero on it, inf for an empty mesh.
    #[pyo3(signature = (points, *, origin=None, threads=None))]
    fn signed_distance(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        origin: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Py<PyArray1<f32>>> {
        let (geometry, threads) = (self.geometry(), Threads::new(threads)?);
        let (points, origin) = (Table::new(points, "points", true)?, geometry.origin(origin)?);
        let distances = nearest::of_points(py, &threads, &points.rows(origin), 0.0, |points, distances| {
            let each = points.iter().zip(distances);
            each.for_each(|(point, distance)| *distance = geometry.mesh.signed_distance(*point));
        })?;
        Ok(PyArray1::from_vec(py, distances).unbind())
    }

    /// refit(vertices, *, threads=None)
    ///
    /// Moves the vertices: (n, 3) floats, as many as in the build, for the same triangles.
    ///
    /// Answers are then those of a new BVH. Hits found before keep their positions, and a Tlas keeps the old mesh.
    ///
    /// Returns
    /// -------
    /// dict
    ///     cost_built, cost_before, cost_now: predicted traversal costs; drift: how many times more expensive the BVH is than when it was
    ///     built; rebuild_advised: whether to build a new one.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Another number of vertices, or a triangle with a vertex that is not finite. The BVH is then unchanged.
    #[pyo3(signature = (vertices, *, threads=None))]
    fn refit<'py>(
        &self,
        py: Python<'py>,
        vertices: &Bound<'py, PyAny>,
        threads: Option<i64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let threads = Threads::new(threads)?;
        let refit = geometry::refit(py, &threads, &self.geometry, vertices)?;
        geometry::report(py, &refit)
    }

    /// save(path)
    ///
    /// Writes the BVH to a file, which Bvh.load reads. The file is complete or absent.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let geometry = self.geometry();
        work::run(py, &Threads::all()?, move || file::save(&path, &geometry))?
    }

    /// load(path)
    ///
    /// The BVH that save wrote. A file of the Rust library (WideBvh::to_bytes of triangles) is read as a watertight one, which has no refit.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be read.
    /// ValueError
    ///     The file is not a BVH, or is damaged.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self::of(work::run(py, &Threads::all()?, move || file::load(&path))??))
    }

    #[classmethod]
    fn _from_bytes(_class: &Bound<'_, PyType>, py: Python<'_>, bytes: Vec<u8>) -> PyResult<Self> {
        let geometry = work::run(py, &Threads::all()?, move || file::from_bytes(&bytes))?;
        Ok(Self::of(geometry.map_err(invalid)?))
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let geometry = self.geometry();
        let bytes = work::run(py, &Threads::all()?, move || file::to_bytes(&geometry))?;
        Ok((py.get_type::<Self>().getattr("_from_bytes")?, (PyBytes::new(py, &bytes),)))
    }

    /// stats()
    ///
    /// Numbers about the BVH, as a dict: triangles, vertices, bytes, node_bytes, leaf_bytes, aligned_nodes, oriented_nodes, depth,
    /// predicted_cost and predicted_cost_aligned (of a ray that enters the root, in tests of aligned nodes), preset, triangle_test,
    /// simd, origin.
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.geometry().stats(py)
    }

    /// The least and the greatest coordinates, (2, 3) float64 in the space of the caller; inf and -inf for an empty mesh.
    #[getter]
    fn bounds(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        table(py, self.geometry().bounds().as_flattened().to_vec())
    }

    /// What is subtracted from coordinates, as a tuple of three floats.
    #[getter]
    fn origin(&self) -> (f64, f64, f64) {
        self.geometry().origin.into()
    }

    fn __len__(&self) -> usize {
        self.geometry().mesh.n_primitives()
    }

    fn __bool__(&self) -> bool {
        true
    }

    fn __repr__(&self) -> String {
        self.geometry().to_string()
    }
}
