use canted::distance::{NearestPoint, NearestSurface, closest_to_zero};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::arrays::{Rows, Table, shaped};
use crate::error::{filled, invalid};
use crate::geometry::Geometry;
use crate::work::Call;

/// Points of a job.
const POINTS_OF_JOB: usize = 256;

/// The nearest points of a mesh: one row for each query point, in the shape of the points; of k_nearest, k for each.
///
/// Attributes
/// ----------
/// distance : (n,) float32
///     Distance; inf where nothing is within max_distance, NaN for a point with a NaN. float64 for a mesh whose origin was chosen near it.
/// primitive : (n,) int32
///     Index of the triangle, of several at one distance the lowest; -1 where there is none.
/// instance : (n,) int32 or None
///     Index of the instance; -1 where there is none; None without a Tlas.
/// position : (n, 3) float64
///     The nearest point, in the space of the caller; NaN where there is none.
#[pyclass(frozen, weakref, module = "canted", get_all)]
pub(crate) struct Nearest {
    distance: Py<PyAny>,
    primitive: Py<PyAny>,
    instance: Option<Py<PyAny>>,
    position: Py<PyAny>,
}

#[pymethods]
impl Nearest {
    #[classmethod]
    fn _of_columns(
        _class: &Bound<'_, PyType>,
        distance: Py<PyAny>,
        primitive: Py<PyAny>,
        instance: Option<Py<PyAny>>,
        position: Py<PyAny>,
    ) -> Self {
        Self { distance, primitive, instance, position }
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let columns = (&self.distance, &self.primitive, &self.instance, &self.position).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of_columns")?, columns))
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.distance.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let numpy = py.import("numpy")?;
        let is_found = numpy.call_method1("greater_equal", (&self.primitive, 0))?;
        let n_found: usize = numpy.call_method1("count_nonzero", (is_found,))?.extract()?;
        let n: usize = numpy.call_method1("size", (&self.distance,))?.extract()?;
        Ok(format!("Nearest({n} points, {n_found} within the distance)"))
    }
}

/// A triangle near a point; relative to the origin of the query.
#[derive(Clone, Copy)]
pub(crate) struct Found {
    pub(crate) distance: f64,
    primitive: u32,
    instance: u32,
    position: [f64; 3],
}

impl From<NearestPoint> for Found {
    fn from(near: NearestPoint) -> Self {
        let (distance, position) = (f64::from(near.distance), near.position.map(f64::from));
        Self { distance, primitive: near.primitive.0, instance: 0, position }
    }
}

impl From<NearestSurface> for Found {
    fn from(near: NearestSurface) -> Self {
        let NearestSurface { distance, position, primitive, instance } = near;
        Self { distance, primitive: primitive.0, instance: instance.0, position }
    }
}

/// What `nearest` and `k_nearest` are asked for.
pub(crate) struct Wanted {
    /// Triangles for each point; none: one, without an axis of its own.
    pub(crate) k: Option<usize>,
    pub(crate) max_distance: f64,
}

impl Wanted {
    pub(crate) fn some(k: i64, max_distance: f64) -> PyResult<Self> {
        let k =
            usize::try_from(k).ok().filter(|&k| k > 0).ok_or_else(|| invalid(format!("k is {k}; use 1 or more")))?;
        Ok(Self { k: Some(k), max_distance })
    }

    pub(crate) fn one(max_distance: f64) -> Self {
        Self { k: None, max_distance }
    }
}

/// The nearest triangles of a mesh to a point, which is relative to the origin.
pub(crate) fn of_mesh(geometry: &Geometry, point: [f64; 3], k: usize, max_distance: f64) -> Vec<Found> {
    let mut near = vec![];
    if geometry.is_near {
        // The point is rounded only to find the triangles.
        let at = point.map(|x| x as f32);
        geometry.mesh.nearest_points(at, k, reach_from(&[point], max_distance), &mut near);
        let triangle = |near: &NearestPoint| (near.primitive.0, geometry.mesh.triangle(near.primitive));
        exact(near.iter().map(triangle), point, max_distance)
    } else {
        geometry.mesh.nearest_points(point.map(|x| x as f32), k, max_distance as f32, &mut near);
        near.into_iter().map(Found::from).collect()
    }
}

/// A distance from points rounded to `f32` within which everything is that is within `max_distance` of the points.
pub(crate) fn reach_from(points: &[[f64; 3]], max_distance: f64) -> f32 {
    let reach = max_distance as f32;
    let reach = if f64::from(reach) < max_distance { reach.next_up() } else { reach };
    let rounding = |point: &[f64; 3]| point.iter().map(|&x| (x - f64::from(x as f32)).abs()).sum::<f64>();
    // Of a point that is not finite, nothing is at a distance.
    let greatest = points.iter().map(rounding).filter(|x| x.is_finite()).fold(0.0, f64::max);
    (f64::from(reach) + greatest) as f32
}

/// The closest points, in `f64`, of triangles that were found, nearest first.
pub(crate) fn exact(
    triangles: impl Iterator<Item = (u32, [[f32; 3]; 3])>,
    point: [f64; 3],
    max_distance: f64,
) -> Vec<Found> {
    let closest = |(primitive, vertices): (u32, [[f32; 3]; 3])| {
        let triangle = vertices.map(|vertex| std::array::from_fn(|k| f64::from(vertex[k]) - point[k]));
        let closest = closest_to_zero(&triangle);
        let [a, b, c]: [[f64; 3]; 3] = triangle;
        let position =
            std::array::from_fn(|k| point[k] + (a[k] + (closest.u * (b[k] - a[k]) + closest.v * (c[k] - a[k]))));
        Found { distance: closest.distance_squared.sqrt(), primitive, instance: 0, position }
    };
    let mut found: Vec<Found> = triangles.map(closest).filter(|found| found.distance <= max_distance).collect();
    found.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    found
}

/// The nearest triangles to each point, by `find`, which gets a point relative to `origin` and how many to find.
pub(crate) fn nearest(
    call: &Call<'_>,
    points: &Table<'_>,
    origin: [f64; 3],
    wanted: &Wanted,
    (has_instances, is_near): (bool, bool),
    find: impl Fn([f64; 3], usize, f64) -> Vec<Found> + Sync + Send,
) -> PyResult<Nearest> {
    let (rows, k) = (points.rows(origin), wanted.k.unwrap_or(1));
    let Some(n) = rows.len().checked_mul(k).filter(|n| n.checked_mul(3).is_some()) else {
        return Err(PyMemoryError::new_err(format!(
            "not enough memory for {k} triangles for each of {} points",
            rows.len()
        )));
    };
    let (mut distance, mut primitive) = (filled(n, f64::INFINITY)?, filled(n, -1)?);
    let mut instance = filled(if has_instances { n } else { 0 }, -1)?;
    let mut position = filled(3 * n, f64::NAN)?;
    let n_of_job = POINTS_OF_JOB.div_ceil(k) * k;
    let mut instances = instance.chunks_mut(n_of_job);
    let parts = distance.chunks_mut(n_of_job).zip(primitive.chunks_mut(n_of_job));
    let parts = parts.zip(position.chunks_mut(3 * n_of_job)).enumerate();
    let jobs = parts.map(|(job, part)| (job, part, instances.next().unwrap_or_default())).collect();
    call.for_jobs(jobs, |(job, ((distance, primitive), position), instance)| {
        for i in 0..distance.len() / k {
            let point = rows.exact(job * (n_of_job / k) + i);
            let of_point = i * k..(i + 1) * k;
            if point.iter().any(|x| x.is_nan()) {
                distance[of_point].fill(f64::NAN);
                continue;
            }
            for (row, found) in of_point.zip(find(point, k, wanted.max_distance)) {
                distance[row] = found.distance;
                primitive[row] = i32::try_from(found.primitive).unwrap_or(i32::MAX);
                if let Some(instance) = instance.get_mut(row) {
                    *instance = i32::try_from(found.instance).unwrap_or(i32::MAX);
                }
                position[3 * row..3 * row + 3]
                    .copy_from_slice(&[0, 1, 2].map(|axis| found.position[axis] + origin[axis]));
            }
        }
    })?;
    let (py, shape) = (call.py, &points.shape[..]);
    let inner = wanted.k.as_slice();
    Ok(Nearest {
        distance: distances(py, distance, is_near, shape, inner)?,
        primitive: shaped(py, primitive, shape, inner)?,
        instance: if has_instances { Some(shaped(py, instance, shape, inner)?) } else { None },
        position: shaped(py, position, shape, &[inner, &[3]].concat())?,
    })
}

/// The nearest triangles to each point, which were found; `points` are relative to the origin.
pub(crate) fn of_lists(
    py: Python<'_>,
    (points, found): (&[[f64; 3]], &[Vec<Found>]),
    origin: [f64; 3],
    wanted: &Wanted,
    (has_instances, is_near): (bool, bool),
    shape: &[usize],
) -> PyResult<Nearest> {
    let k = wanted.k.unwrap_or(1);
    let n = points.len().saturating_mul(k);
    let (mut distance, mut primitive) = (filled(n, f64::INFINITY)?, filled(n, -1)?);
    let mut instance = filled(if has_instances { n } else { 0 }, -1)?;
    let mut position = filled(n.saturating_mul(3), f64::NAN)?;
    for (i, (point, found)) in points.iter().zip(found).enumerate() {
        if point.iter().any(|x| x.is_nan()) {
            distance[i * k..(i + 1) * k].fill(f64::NAN);
        }
        for (row, found) in (i * k..(i + 1) * k).zip(found) {
            distance[row] = found.distance;
            primitive[row] = i32::try_from(found.primitive).unwrap_or(i32::MAX);
            if let Some(instance) = instance.get_mut(row) {
                *instance = i32::try_from(found.instance).unwrap_or(i32::MAX);
            }
            position[3 * row..3 * row + 3].copy_from_slice(&[0, 1, 2].map(|axis| found.position[axis] + origin[axis]));
        }
    }
    let inner = wanted.k.as_slice();
    Ok(Nearest {
        distance: distances(py, distance, is_near, shape, inner)?,
        primitive: shaped(py, primitive, shape, inner)?,
        instance: if has_instances { Some(shaped(py, instance, shape, inner)?) } else { None },
        position: shaped(py, position, shape, &[inner, &[3]].concat())?,
    })
}

/// Distances as an array of `float64`, or else of `float32`.
pub(crate) fn distances(
    py: Python<'_>,
    distances: Vec<f64>,
    is_near: bool,
    shape: &[usize],
    inner: &[usize],
) -> PyResult<Py<PyAny>> {
    if is_near {
        return shaped(py, distances, shape, inner);
    }
    shaped(py, distances.into_iter().map(|x| x as f32).collect(), shape, inner)
}

/// One answer for each point, by slices of points.
pub(crate) fn of_points<T: Clone + Send>(
    call: &Call<'_>,
    points: &Rows<'_>,
    empty: T,
    answer: impl Fn(&[[f64; 3]], &mut [T]) + Sync + Send,
) -> PyResult<Vec<T>> {
    let mut answers = filled(points.len(), empty)?;
    let jobs = answers.chunks_mut(POINTS_OF_JOB).enumerate().collect();
    call.for_jobs(jobs, |(job, answers): (usize, &mut [T])| {
        let first = job * POINTS_OF_JOB;
        let points: Vec<[f64; 3]> = (first..first + answers.len()).map(|i| points.exact(i)).collect();
        answer(&points, answers);
    })?;
    Ok(answers)
}

/// Points rounded to `f32`.
pub(crate) fn rounded(points: &[[f64; 3]]) -> Vec<[f32; 3]> {
    points.iter().map(|point| point.map(|x| x as f32)).collect()
}
