//! Where hits lie: positions and normals, computed when they are first asked for.

use std::sync::Arc;

use canted::{Hit, InstanceId, PrimId, Side, SurfacePoint, TriangleBvh};
use numpy::ndarray::Array2;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::{filled, invalid};
use crate::geometry::Geometry;
use crate::threads::Threads;
use crate::work::for_jobs;

/// Hits of a job.
const HITS_OF_JOB: usize = 4096;

/// What was hit, as it was then: a refit makes a copy.
pub(crate) enum Surface {
    Mesh { geometry: Arc<Geometry>, origin: [f64; 3] },
    Tlas(Arc<canted::Tlas<Arc<TriangleBvh>>>),
}

/// The arrays that say which points.
pub(crate) struct Places<'a> {
    pub(crate) primitive: &'a Py<PyArray1<i32>>,
    pub(crate) u: &'a Py<PyArray1<f32>>,
    pub(crate) v: &'a Py<PyArray1<f32>>,
    pub(crate) instance: Option<&'a Py<PyArray1<i32>>>,
}

/// Positions and unit normals, of shape (n, 3).
pub(crate) type Points = [Py<PyArray2<f64>>; 2];

impl Surface {
    /// The point of a hit, in the space of the caller; an error names what does not exist.
    fn point(&self, hit: &Hit) -> Option<SurfacePoint> {
        let vertices =
            |mesh: &TriangleBvh| (hit.primitive.index() < mesh.n_primitives()).then(|| mesh.triangle(hit.primitive));
        match self {
            Self::Mesh { geometry, origin } => {
                let point = SurfacePoint::new(hit, vertices(&geometry.mesh)?, geometry.mesh.aabb().reach());
                let position = std::array::from_fn(|k| point.position[k] + origin[k]);
                Some(SurfacePoint { position, ..point })
            }
            Self::Tlas(tlas) => {
                let instance = tlas.instances().get(hit.instance.0 as usize)?;
                let mesh = tlas.blas().get(instance.blas as usize)?;
                let reach = mesh.aabb().reach();
                Some(SurfacePoint::in_instance(hit, vertices(mesh)?, reach, &instance.world_from_object))
            }
        }
    }

    /// The points of all hits; NaN for a miss.
    pub(crate) fn points(&self, py: Python<'_>, places: &Places<'_>) -> PyResult<Points> {
        let [u, v] = [places.u, places.v].map(|array| array.bind(py).readonly());
        let primitive = places.primitive.bind(py).readonly();
        let instance = places.instance.map(|array| array.bind(py).readonly());
        let (primitive, u, v) = (primitive.as_array(), u.as_array(), v.as_array());
        let instance = instance.as_ref().map(|array| array.as_array());
        let n = primitive.len();
        let mut points = [filled(3 * n, f64::NAN)?, filled(3 * n, f64::NAN)?];
        let [position, normal] = &mut points;
        let flaw = std::sync::Mutex::new(None);
        let parts = position.chunks_mut(3 * HITS_OF_JOB).zip(normal.chunks_mut(3 * HITS_OF_JOB));
        for_jobs(py, &Threads::all()?, parts.enumerate().collect(), |(job, (position, normal))| {
            let rows = position.as_chunks_mut().0.iter_mut().zip(normal.as_chunks_mut().0);
            for (i, (position, normal)) in (job * HITS_OF_JOB..).zip(rows) {
                // Negative for a miss.
                let Ok(id) = u32::try_from(primitive[i]) else { continue };
                let instance = instance.as_ref().map_or(0, |instance| u32::try_from(instance[i]).unwrap_or(u32::MAX));
                // Time and side are not needed.
                let hit = Hit {
                    t: 0.0,
                    u: u[i],
                    v: v[i],
                    primitive: PrimId(id),
                    instance: InstanceId(instance),
                    side: Side::Front,
                };
                match self.point(&hit) {
                    Some(point) => (*position, *normal) = (point.position, point.normal),
                    None => *flaw.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(i),
                }
            }
        })?;
        if let Some(i) = flaw.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
            return Err(invalid(format!("hit {i} is on triangle {}, which does not exist", primitive[i])));
        }
        let [position, normal] = points;
        Ok([table(py, position)?, table(py, normal)?])
    }
}

/// Rows of three numbers as an array of shape (n, 3).
pub(crate) fn table(py: Python<'_>, numbers: Vec<f64>) -> PyResult<Py<PyArray2<f64>>> {
    let n = numbers.len() / 3;
    let array = Array2::from_shape_vec((n, 3), numbers).map_err(invalid)?;
    Ok(PyArray2::from_owned_array(py, array).unbind())
}
