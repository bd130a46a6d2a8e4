use canted::TriangleBvh;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{Rows, Table};
use crate::error::filled;
use crate::points::table;
use crate::threads::Threads;
use crate::work::for_jobs;

/// Points of a job.
const POINTS_OF_JOB: usize = 256;

/// The nearest points of a mesh: one row for each query point.
///
/// Attributes
/// ----------
/// distance : (n,) float32
///     Distance; inf where nothing is within max_distance.
/// primitive : (n,) int32
///     Index of the triangle, of several at one distance the lowest; -1 where there is none.
/// position : (n, 3) float64
///     The nearest point, in the space of the caller; NaN where there is none.
#[pyclass(frozen, module = "canted")]
pub(crate) struct Nearest {
    #[pyo3(get)]
    distance: Py<PyArray1<f32>>,
    #[pyo3(get)]
    primitive: Py<PyArray1<i32>>,
    #[pyo3(get)]
    position: Py<PyArray2<f64>>,
}

#[pymethods]
impl Nearest {
    fn __len__(&self, py: Python<'_>) -> usize {
        self.distance.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let n_found = self.primitive.bind(py).readonly().as_array().iter().filter(|&&id| id >= 0).count();
        format!("Nearest({} points, {n_found} within the distance)", self.distance.bind(py).len())
    }
}

/// The nearest point of the mesh to each point.
pub(crate) fn nearest(
    py: Python<'_>,
    threads: &Threads,
    mesh: &TriangleBvh,
    points: &Table<'_>,
    origin: [f64; 3],
    max_distance: f64,
) -> PyResult<Nearest> {
    let points = points.rows(origin);
    let max_distance = max_distance as f32;
    let n = points.len();
    let (mut distance, mut primitive) = (filled(n, f32::INFINITY)?, filled(n, -1)?);
    let mut position = filled(3 * n, f64::NAN)?;
    let parts = distance.chunks_mut(POINTS_OF_JOB).zip(primitive.chunks_mut(POINTS_OF_JOB));
    let parts = parts.zip(position.chunks_mut(3 * POINTS_OF_JOB)).enumerate();
    for_jobs(py, threads, parts.collect(), |(job, ((distance, primitive), position))| {
        for (i, position) in position.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let point = points.get(job * POINTS_OF_JOB + i);
            let Some(nearest) = mesh.nearest_point(point, max_distance) else { continue };
            distance[i] = nearest.distance;
            primitive[i] = i32::try_from(nearest.primitive.0).unwrap_or(i32::MAX);
            *position = std::array::from_fn(|k| f64::from(nearest.position[k]) + origin[k]);
        }
    })?;
    Ok(Nearest {
        distance: PyArray1::from_vec(py, distance).unbind(),
        primitive: PyArray1::from_vec(py, primitive).unbind(),
        position: table(py, position)?,
    })
}

/// One answer for each point, by slices of points.
pub(crate) fn of_points<T: Clone + Send>(
    py: Python<'_>,
    threads: &Threads,
    points: &Rows<'_>,
    empty: T,
    answer: impl Fn(&[[f32; 3]], &mut [T]) + Sync + Send,
) -> PyResult<Vec<T>> {
    let mut answers = filled(points.len(), empty)?;
    let jobs = answers.chunks_mut(POINTS_OF_JOB).enumerate().collect();
    for_jobs(py, threads, jobs, |(job, answers): (usize, &mut [T])| {
        let first = job * POINTS_OF_JOB;
        let points: Vec<[f32; 3]> = (first..first + answers.len()).map(|i| points.get(i)).collect();
        answer(&points, answers);
    })?;
    Ok(answers)
}
