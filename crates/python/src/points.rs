//! Where hits lie: positions and normals, computed when they are first asked for.

use std::sync::Arc;

use canted::file::tiles::TiledBvh;
use canted::{Affine, Hit, InstanceId, PrimId, Side, SurfacePoint, TriangleBvh};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use crate::arrays::shaped;
use crate::error::{filled, invalid};
use crate::geometry::Geometry;
use crate::work::Call;

/// Hits of a job.
const HITS_OF_JOB: usize = 4096;

/// An instance that was hit.
pub(crate) struct Placed {
    pub(crate) id: InstanceId,
    pub(crate) mesh: Arc<TriangleBvh>,
    pub(crate) world_from_object: Affine,
}

/// What was hit, as it was then: a refit makes a copy.
#[derive(Clone)]
pub(crate) enum Surface {
    Mesh {
        geometry: Arc<Geometry>,
        origin: [f64; 3],
    },
    /// The instances that were hit, in ascending order: the top level may change, and is not copied for that.
    Tlas {
        placed: Arc<[Placed]>,
        origin: [f64; 3],
        is_near: bool,
    },
    Tiles {
        bvh: Arc<TiledBvh>,
        origin: [f64; 3],
    },
}

/// The arrays that say which points.
pub(crate) struct Places<'py> {
    pub(crate) primitive: PyReadonlyArray1<'py, i32>,
    pub(crate) u: PyReadonlyArray1<'py, f32>,
    pub(crate) v: PyReadonlyArray1<'py, f32>,
    pub(crate) instance: Option<PyReadonlyArray1<'py, i32>>,
}

/// Positions and unit normals, of shape (..., 3).
pub(crate) type Points = [Py<PyAny>; 2];

impl Surface {
    /// Whether the origin was chosen near it, so that results are `float64`.
    pub(crate) fn is_near(&self) -> bool {
        match self {
            Self::Mesh { geometry, .. } => geometry.is_near,
            Self::Tlas { is_near, .. } => *is_near,
            Self::Tiles { bvh, .. } => bvh.is_near(),
        }
    }

    /// The vertices of hits on tiles, which were read before; none of what is in memory.
    fn read(&self, primitive: impl Iterator<Item = i32>) -> PyResult<Vec<Option<[[f32; 3]; 3]>>> {
        let Self::Tiles { bvh, .. } = self else { return Ok(vec![]) };
        // Of a miss, no triangle has the number.
        let numbers: Vec<u32> = primitive.map(|number| u32::try_from(number).unwrap_or(u32::MAX)).collect();
        bvh.try_triangles(&numbers).map_err(invalid)
    }

    /// The point of a hit, in the space of the caller; an error names what does not exist. `read` are its vertices on tiles.
    fn point(&self, hit: &Hit, read: Option<[[f32; 3]; 3]>) -> Option<SurfacePoint> {
        let vertices =
            |mesh: &TriangleBvh| (hit.primitive.index() < mesh.n_primitives()).then(|| mesh.triangle(hit.primitive));
        let (point, origin) = match self {
            Self::Mesh { geometry, origin } => {
                (SurfacePoint::new(hit, vertices(&geometry.mesh)?, geometry.mesh.aabb().reach()), origin)
            }
            Self::Tiles { bvh, origin } => (SurfacePoint::new(hit, read?, bvh.aabb().reach()), origin),
            Self::Tlas { placed, origin, .. } => {
                let place = placed.binary_search_by_key(&hit.instance.0, |placed| placed.id.0).ok()?;
                let Placed { mesh, world_from_object, .. } = &placed[place];
                let reach = mesh.aabb().reach();
                (SurfacePoint::in_instance(hit, vertices(mesh)?, reach, world_from_object), origin)
            }
        };
        let position = std::array::from_fn(|k| point.position[k] + origin[k]);
        Some(SurfacePoint { position, ..point })
    }

    /// The points of all hits, in columns of this shape; NaN for a miss.
    pub(crate) fn points(&self, call: &Call<'_>, places: &Places<'_>, shape: &[usize]) -> PyResult<Points> {
        let (primitive, u, v) = (places.primitive.as_array(), places.u.as_array(), places.v.as_array());
        let instance = places.instance.as_ref().map(|array| array.as_array());
        let n = primitive.len();
        let read = self.read(primitive.iter().copied())?;
        let mut points = [filled(3 * n, f64::NAN)?, filled(3 * n, f64::NAN)?];
        let [position, normal] = &mut points;
        let flaw = std::sync::Mutex::new(None);
        let parts = position.chunks_mut(3 * HITS_OF_JOB).zip(normal.chunks_mut(3 * HITS_OF_JOB));
        call.for_jobs(parts.enumerate().collect(), |(job, (position, normal))| {
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
                match self.point(&hit, read.get(i).copied().flatten()) {
                    Some(point) => (*position, *normal) = (point.position, point.normal),
                    None => *flaw.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(i),
                }
            }
        })?;
        if let Some(i) = flaw.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
            return Err(invalid(format!("hit {i} is on triangle {}, which does not exist", primitive[i])));
        }
        let [position, normal] = points;
        Ok([shaped(call.py, position, shape, &[3])?, shaped(call.py, normal, shape, &[3])?])
    }
}
