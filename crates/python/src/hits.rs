use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use crate::points::{Places, Points, Surface};
use crate::query::Columns;

/// Hits of rays: one row for each ray, or for each hit.
///
/// closest_hit returns one row for each ray, in the order of the rays; a miss has t = inf and primitive = -1. all_hits and crossings
/// return one row for each hit: those of ray 0 in order of t, then those of ray 1, and so on.
///
/// Attributes
/// ----------
/// t : (n,) float32
///     Distance along the ray in units of its direction; inf for a miss.
/// primitive : (n,) int32
///     Index of the triangle; -1 for a miss.
/// u, v : (n,) float32
///     Barycentric coordinates: the point is (1 - u - v)*a + u*b + v*c.
/// entering : (n,) bool
///     Whether the ray hits the front side, from which the vertices run counter-clockwise: it enters a solid there.
/// ray : (n,) int64
///     Index of the ray.
/// hit : (n,) bool
///     Whether the row is a hit.
/// instance : (n,) int32 or None
///     Index of the instance; -1 for a miss; None without a Tlas.
/// position : (n, 3) float64
///     The point on the triangle, by u and v, in the space of the caller; NaN for a miss. Computed on first access.
/// normal : (n, 3) float64
///     Unit normal of the triangle's front side; NaN for a miss. Computed on first access.
///
/// Triangles are those at the time of the query, also after a refit.
#[pyclass(frozen, module = "canted")]
pub(crate) struct Hits {
    ray: PyOnceLock<Py<PyArray1<i64>>>,
    #[pyo3(get)]
    t: Py<PyArray1<f32>>,
    #[pyo3(get)]
    primitive: Py<PyArray1<i32>>,
    #[pyo3(get)]
    u: Py<PyArray1<f32>>,
    #[pyo3(get)]
    v: Py<PyArray1<f32>>,
    #[pyo3(get)]
    entering: Py<PyArray1<bool>>,
    #[pyo3(get)]
    instance: Option<Py<PyArray1<i32>>>,
    points: PyOnceLock<Points>,
    surface: Surface,
    n_rays: usize,
    /// Whether there is a row for each hit instead of one for each ray.
    is_list: bool,
}

impl Hits {
    pub(crate) fn new(py: Python<'_>, columns: Columns, surface: Surface, n_rays: usize) -> Self {
        let is_list = columns.ray.is_some();
        let ray = PyOnceLock::new();
        if let Some(rays) = columns.ray {
            let _ = ray.set(py, PyArray1::from_vec(py, rays).unbind());
        }
        let has_instances = matches!(surface, Surface::Tlas(_));
        Self {
            ray,
            t: PyArray1::from_vec(py, columns.t).unbind(),
            primitive: PyArray1::from_vec(py, columns.primitive).unbind(),
            u: PyArray1::from_vec(py, columns.u).unbind(),
            v: PyArray1::from_vec(py, columns.v).unbind(),
            entering: PyArray1::from_vec(py, columns.entering).unbind(),
            instance: has_instances.then(|| PyArray1::from_vec(py, columns.instance).unbind()),
            points: PyOnceLock::new(),
            surface,
            n_rays,
            is_list,
        }
    }

    fn points(&self, py: Python<'_>) -> PyResult<&Points> {
        let places = Places { primitive: &self.primitive, u: &self.u, v: &self.v, instance: self.instance.as_ref() };
        self.points.get_or_try_init(py, || self.surface.points(py, &places))
    }
}

#[pymethods]
impl Hits {
    #[getter]
    fn ray(&self, py: Python<'_>) -> PyResult<Py<PyArray1<i64>>> {
        let one_each = || {
            let n = i64::try_from(self.t.bind(py).len()).unwrap_or(i64::MAX);
            PyArray1::arange(py, 0, n, 1).unbind()
        };
        Ok(self.ray.get_or_init(py, one_each).clone_ref(py))
    }

    #[getter]
    fn hit(&self, py: Python<'_>) -> Py<PyArray1<bool>> {
        let hit = self.primitive.bind(py).readonly().as_array().iter().map(|&id| id >= 0).collect();
        PyArray1::from_vec(py, hit).unbind()
    }

    #[getter]
    fn position(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        Ok(self.points(py)?[0].clone_ref(py))
    }

    #[getter]
    fn normal(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        Ok(self.points(py)?[1].clone_ref(py))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.t.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let n_hits = self.primitive.bind(py).readonly().as_array().iter().filter(|&&id| id >= 0).count();
        let n_rays = self.n_rays;
        if self.is_list {
            format!("Hits({n_hits} hits of {n_rays} rays)")
        } else {
            format!("Hits({n_rays} rays, {n_hits} of them hit)")
        }
    }
}
