use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};

use crate::arrays::shaped;
use crate::points::{Places, Points, Surface};
use crate::query::Columns;
use crate::work::Call;

/// Hits of rays: one row for each ray, or for each hit.
///
/// closest_hit returns one row for each ray, in the shape of the rays: rays of shape (h, w, 3) have columns of shape (h, w). A miss has
/// t = inf and primitive = -1. all_hits and crossings return one row for each hit: those of ray 0 in order of t, then those of ray 1, and so
/// on. The shapes below are those of (n,) rows.
///
/// hits[index] has the rows that NumPy's indexing picks of an array of this shape, hits[5] a single row, whose columns are numbers. Hits are
/// iterated row by row and can be pickled.
///
/// Attributes
/// ----------
/// t : (n,) float32
///     Distance along the ray in units of its direction; inf for a miss. float64 for a mesh whose origin was chosen near it.
/// primitive : (n,) int32
///     Index of the triangle; -1 for a miss.
/// u, v : (n,) float32
///     Barycentric coordinates: the point is (1 - u - v)*a + u*b + v*c.
/// entering : (n,) bool
///     Whether the ray hits the front side, from which the vertices run counter-clockwise: it enters a solid there.
/// ray : (n,) int64
///     Index of the ray, counted row by row.
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
#[pyclass(frozen, weakref, module = "canted")]
pub(crate) struct Hits {
    ray: PyOnceLock<Py<PyAny>>,
    #[pyo3(get)]
    t: Py<PyAny>,
    #[pyo3(get)]
    primitive: Py<PyAny>,
    #[pyo3(get)]
    u: Py<PyAny>,
    #[pyo3(get)]
    v: Py<PyAny>,
    #[pyo3(get)]
    entering: Py<PyAny>,
    #[pyo3(get)]
    instance: Option<Py<PyAny>>,
    points: PyOnceLock<Points>,
    /// None of hits that come from a pickle, which have their points.
    surface: Option<Surface>,
    n_rays: usize,
    /// Whether there is a row for each hit instead of one for each ray.
    is_list: bool,
}

impl Hits {
    /// Hits of rays of this shape.
    pub(crate) fn new(py: Python<'_>, columns: Columns, surface: Surface, shape: &[usize]) -> PyResult<Self> {
        let (n_rays, is_list) = (shape.iter().product(), columns.ray.is_some());
        let of_list = [columns.t.len()];
        let shape = if is_list { &of_list } else { shape };
        let ray = PyOnceLock::new();
        if let Some(rays) = columns.ray {
            let _ = ray.set(py, shaped(py, rays, shape, &[])?);
        }
        let t = if surface.is_near() {
            // Near nothing, no ray starts later.
            let starts = columns.starts.into_iter().chain(std::iter::repeat(0.0));
            let sums = columns.t.iter().zip(starts).map(|(&t, start)| f64::from(t) + start);
            shaped(py, sums.collect(), shape, &[])?
        } else {
            shaped(py, columns.t, shape, &[])?
        };
        let instance = match &surface {
            Surface::Mesh { .. } => None,
            Surface::Tiles { bvh, .. } if bvh.is_one_mesh() => None,
            Surface::Tiles { .. } => Some(shaped(py, columns.instance, shape, &[])?),
            Surface::Tlas { .. } => Some(shaped(py, columns.instance, shape, &[])?),
        };
        Ok(Self {
            ray,
            t,
            primitive: shaped(py, columns.primitive, shape, &[])?,
            u: shaped(py, columns.u, shape, &[])?,
            v: shaped(py, columns.v, shape, &[])?,
            entering: shaped(py, columns.entering, shape, &[])?,
            instance,
            points: PyOnceLock::new(),
            surface: Some(surface),
            n_rays,
            is_list,
        })
    }

    fn points(&self, py: Python<'_>) -> PyResult<&Points> {
        self.points.get_or_try_init(py, || {
            let Some(surface) = &self.surface else { return Err(PyTypeError::new_err("these hits have no triangles")) };
            let shape = self.shape(py)?;
            let instance = self.instance.as_ref().map(|column| flat(py, column)).transpose()?;
            let instance = instance.map(|array| array.extract::<PyReadonlyArray1<'_, i32>>()).transpose()?;
            let places = Places {
                primitive: flat(py, &self.primitive)?.extract()?,
                u: flat(py, &self.u)?.extract()?,
                v: flat(py, &self.v)?.extract()?,
                instance,
            };
            surface.points(&Call::plain(py)?, &places, &shape)
        })
    }

    /// The shape of each column.
    fn shape(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        py.import("numpy")?.call_method1("shape", (&self.t,))?.extract()
    }

    fn columns(&self, py: Python<'_>) -> PyResult<Vec<(&'static str, Py<PyAny>)>> {
        let mut columns = vec![
            ("ray", self.ray(py)?),
            ("t", self.t.clone_ref(py)),
            ("primitive", self.primitive.clone_ref(py)),
            ("u", self.u.clone_ref(py)),
            ("v", self.v.clone_ref(py)),
            ("entering", self.entering.clone_ref(py)),
        ];
        columns.extend(self.instance.as_ref().map(|instance| ("instance", instance.clone_ref(py))));
        Ok(columns)
    }
}

/// A column as an array of one axis.
fn flat<'py>(py: Python<'py>, column: &Py<PyAny>) -> PyResult<Bound<'py, PyAny>> {
    py.import("numpy")?.call_method1("ravel", (column,))
}

#[pymethods]
impl Hits {
    #[getter]
    fn ray(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let one_each = || {
            let shape = self.shape(py)?;
            let n = i64::try_from(shape.iter().product::<usize>()).unwrap_or(i64::MAX);
            let all = PyArray1::arange(py, 0, n, 1);
            Ok::<_, PyErr>(all.call_method1("reshape", (PyTuple::new(py, shape)?,))?.unbind())
        };
        Ok(self.ray.get_or_try_init(py, one_each)?.clone_ref(py))
    }

    #[getter]
    fn hit(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(py.import("numpy")?.call_method1("greater_equal", (&self.primitive, 0))?.unbind())
    }

    #[getter]
    fn position(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.points(py)?[0].clone_ref(py))
    }

    #[getter]
    fn normal(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.points(py)?[1].clone_ref(py))
    }

    /// to_dict()
    ///
    /// All columns by name: a dict of ray, t, primitive, u, v, entering, hit, position, normal, and with a Tlas instance.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        for (name, column) in self.columns(py)? {
            columns.set_item(name, column)?;
        }
        columns.set_item("hit", self.hit(py)?)?;
        columns.set_item("position", self.position(py)?)?;
        columns.set_item("normal", self.normal(py)?)?;
        Ok(columns)
    }

    fn __getitem__(&self, py: Python<'_>, index: &Bound<'_, PyAny>) -> PyResult<Self> {
        let shape = self.shape(py)?;
        let n = i64::try_from(shape.iter().product::<usize>()).unwrap_or(i64::MAX);
        let numbers = PyArray1::arange(py, 0, n, 1).call_method1("reshape", (PyTuple::new(py, &shape)?,))?;
        let rows = numbers.get_item(index)?;
        let pick = |column: &Py<PyAny>| Ok::<_, PyErr>(flat(py, column)?.get_item(&rows)?.unbind());
        let points = PyOnceLock::new();
        if let (None, Some(given)) = (&self.surface, self.points.get(py)) {
            let of_rows = |array: &Py<PyAny>| {
                let all = array.bind(py).call_method1("reshape", ((-1, 3),))?;
                Ok::<_, PyErr>(all.get_item(&rows)?.unbind())
            };
            let _ = points.set(py, [of_rows(&given[0])?, of_rows(&given[1])?]);
        }
        let ray = PyOnceLock::new();
        let _ = ray.set(py, pick(&self.ray(py)?)?);
        Ok(Self {
            ray,
            t: pick(&self.t)?,
            primitive: pick(&self.primitive)?,
            u: pick(&self.u)?,
            v: pick(&self.v)?,
            entering: pick(&self.entering)?,
            instance: self.instance.as_ref().map(pick).transpose()?,
            points,
            surface: self.surface.clone(),
            n_rays: if self.is_list { self.n_rays } else { rows_in(py, &rows)? },
            is_list: self.is_list,
        })
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let builtins = slf.py().import("builtins")?;
        let range = builtins.call_method1("range", (slf.len()?,))?;
        builtins.call_method1("map", (slf.getattr("__getitem__")?, range))
    }

    #[classmethod]
    fn _of_columns(
        _class: &Bound<'_, PyType>,
        columns: &Bound<'_, PyDict>,
        points: [Py<PyAny>; 2],
        n_rays: usize,
        is_list: bool,
    ) -> PyResult<Self> {
        let py = columns.py();
        let column = |name: &str| Ok::<_, PyErr>(columns.as_any().get_item(name)?.unbind());
        let (ray, given) = (PyOnceLock::new(), PyOnceLock::new());
        let _ = ray.set(py, column("ray")?);
        let _ = given.set(py, points);
        Ok(Self {
            ray,
            t: column("t")?,
            primitive: column("primitive")?,
            u: column("u")?,
            v: column("v")?,
            entering: column("entering")?,
            instance: columns.get_item("instance")?.map(Bound::unbind),
            points: given,
            surface: None,
            n_rays,
            is_list,
        })
    }

    /// For pickle and copy: with positions and normals, without the mesh.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let columns = PyDict::new(py);
        for (name, column) in self.columns(py)? {
            columns.set_item(name, column)?;
        }
        let [position, normal] = self.points(py)?;
        let points = PyTuple::new(py, [position, normal])?;
        let arguments = (columns, points, self.n_rays, self.is_list).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of_columns")?, arguments))
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.shape(py)?.first().copied().ok_or_else(|| PyTypeError::new_err("a single row has no len()"))
    }

    fn __bool__(&self, py: Python<'_>) -> PyResult<bool> {
        match self.shape(py)?.first() {
            Some(&n) => Ok(n > 0),
            None => self.hit(py)?.bind(py).is_truthy(),
        }
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let n_hits: usize = py.import("numpy")?.call_method1("count_nonzero", (self.hit(py)?,))?.extract()?;
        let n_rays = self.n_rays;
        Ok(if self.is_list {
            format!("Hits({n_hits} hits of {n_rays} rays)")
        } else {
            format!("Hits({n_rays} rays, {n_hits} of them hit)")
        })
    }
}

/// Number of rows that an index picks.
fn rows_in(py: Python<'_>, rows: &Bound<'_, PyAny>) -> PyResult<usize> {
    py.import("numpy")?.call_method1("size", (rows,))?.extract()
}
