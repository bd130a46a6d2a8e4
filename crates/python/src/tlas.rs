use std::sync::Arc;

use canted::kernel::HitLists;
use canted::{Affine, Instance, Intersect, Ray, TriangleBvh};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{NO_ORIGIN, matrix};
use crate::bvh::Bvh;
use crate::error::{guard, invalid};
use crate::geometry::Geometry;
use crate::hits::Hits;
use crate::points::{Surface, table};
use crate::query::{RayArrays, all_hits, closest_hits, occluded};
use crate::threads::Threads;

type Inner = canted::Tlas<Arc<TriangleBvh>>;

/// Instances of meshes under affine transforms, with ray queries.
///
/// Parameters
/// ----------
/// bvhs : sequence of Bvh
///     The meshes, as they are now: a later refit does not change the Tlas. An origin of a Bvh is part of its transforms.
/// instances : sequence of (int, (4, 4) floats), optional
///     For each instance the index of its mesh and world_from_object: points are columns, so the translation is the last column. Any
///     invertible map, rounded to float32. Default: each mesh once, as it is.
///
/// Raises
/// ------
/// ValueError
///     A mesh that does not exist; a matrix of another shape, with a last row other than 0, 0, 0, 1, that is not finite or too
///     close to singular.
#[pyclass(frozen, module = "canted")]
pub(crate) struct Tlas {
    tlas: Arc<Inner>,
}

#[pymethods]
impl Tlas {
    #[new]
    #[pyo3(signature = (bvhs, instances=None))]
    fn new(py: Python<'_>, bvhs: &Bound<'_, PyAny>, instances: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let mut geometries: Vec<Arc<Geometry>> = vec![];
        for (i, bvh) in items(bvhs, "bvhs")?.enumerate() {
            let bvh = bvh?;
            let bvh = bvh.cast::<Bvh>().map_err(|_| invalid(format!("item {i} of bvhs is not a Bvh")))?;
            geometries.push(bvh.get().geometry());
        }
        let mut placed = vec![];
        match instances {
            None => placed.extend((0..geometries.len()).map(|index| (index, IDENTITY))),
            Some(instances) => {
                for (i, instance) in items(instances, "instances")?.enumerate() {
                    placed.push(index_and_matrix(i, &instance?, geometries.len())?);
                }
            }
        }
        let instances = placed.iter().map(|(index, matrix)| {
            let affine = affine(matrix, geometries[*index].origin);
            Ok(Instance::new(u32::try_from(*index).map_err(invalid)?, affine))
        });
        let instances = instances.collect::<PyResult<Vec<_>>>()?;
        let blas = geometries.iter().map(|geometry| Arc::clone(&geometry.mesh)).collect();
        let build = || Inner::new(blas, &instances, Default::default());
        let threads = Threads::all()?;
        let tlas = py.detach(|| guard(|| threads.run(build)))?.map_err(invalid)?;
        Ok(Self { tlas: Arc::new(tlas) })
    }

    /// closest_hit(origins, directions, t_min=0, t_max=inf, *, threads=None)
    ///
    /// The first hit of each ray, world space: Hits with instance. Of equal t the lowest (instance, triangle) is reported.
    ///
    /// Parameters and errors are those of Bvh.closest_hit; t is in units of the caller's direction.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=None))]
    fn closest_hit(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Hits> {
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let rays = arrays.rays(NO_ORIGIN);
        let columns = closest_hits(py, &Threads::new(threads)?, &*self.tlas, &rays, true)?;
        Ok(Hits::new(py, columns, Surface::Tlas(Arc::clone(&self.tlas)), rays.len()))
    }

    /// occluded(origins, directions, t_min=0, t_max=inf, *, threads=None)
    ///
    /// Whether each ray hits anything: (n,) bool. Agrees with closest_hit, and is faster.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=None))]
    fn occluded(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Py<PyArray1<bool>>> {
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let found = occluded(py, &Threads::new(threads)?, &*self.tlas, &arrays.rays(NO_ORIGIN))?;
        Ok(PyArray1::from_vec(py, found).unbind())
    }

    /// all_hits(origins, directions, t_min=0, t_max=inf, *, threads=None)
    ///
    /// Every hit of every ray: Hits with instance, one row for each hit, in order of ray, then t, then (instance, triangle).
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=None))]
    fn all_hits(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Hits> {
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let rays = arrays.rays(NO_ORIGIN);
        let list = |rays: &[Ray], lists: &mut HitLists| self.tlas.all_hits_listed(rays, lists);
        let columns = all_hits(py, &Threads::new(threads)?, &list, &rays, true)?;
        Ok(Hits::new(py, columns, Surface::Tlas(Arc::clone(&self.tlas)), rays.len()))
    }

    /// stats()
    ///
    /// Numbers about the Tlas, as a dict: bvhs, instances, triangles (of each mesh once), bytes (of the top level).
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stats = PyDict::new(py);
        stats.set_item("bvhs", self.tlas.blas().len())?;
        stats.set_item("instances", self.tlas.n_instances())?;
        stats.set_item("triangles", self.tlas.blas().iter().map(|mesh| mesh.n_primitives()).sum::<usize>())?;
        stats.set_item("bytes", self.tlas.n_bytes())?;
        Ok(stats)
    }

    /// The least and the greatest coordinates, (2, 3) float64, world space; inf and -inf without instances.
    #[getter]
    fn bounds(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let aabb = self.tlas.aabb();
        table(py, [aabb.min, aabb.max].as_flattened().iter().map(|&x| f64::from(x)).collect())
    }

    fn __len__(&self) -> usize {
        self.tlas.n_instances()
    }

    fn __bool__(&self) -> bool {
        true
    }

    fn __repr__(&self) -> String {
        format!("Tlas({} instances of {} meshes)", self.tlas.n_instances(), self.tlas.blas().len())
    }
}

/// Rows of a map to world space, translations last.
type Rows = [[f64; 4]; 3];

const IDENTITY: Rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// The items of a sequence.
fn items<'py>(
    argument: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<impl Iterator<Item = PyResult<Bound<'py, PyAny>>> + use<'py>> {
    argument.try_iter().map_err(|_| invalid(format!("{name} is not a sequence")))
}

/// One item of `instances`.
fn index_and_matrix(i: usize, instance: &Bound<'_, PyAny>, n_meshes: usize) -> PyResult<(usize, Rows)> {
    let pair = instance.py().get_type::<PyTuple>().call1((instance,));
    let pair: Vec<Bound<'_, PyAny>> = pair.and_then(|pair| pair.extract()).unwrap_or_default();
    let [index, rows] = &pair[..] else {
        return Err(invalid(format!("instance {i} is not a pair of an index and a matrix")));
    };
    let number: i64 = index.extract().map_err(|_| invalid(format!("instance {i} has an index that is no integer")))?;
    let index = usize::try_from(number).ok().filter(|&index| index < n_meshes);
    let index =
        index.ok_or_else(|| invalid(format!("instance {i} has BVH {number}, but the list bvhs has {n_meshes}")))?;
    let [x, y, z, last] = matrix(rows, &format!("the matrix of instance {i}"))?;
    if last != [0.0, 0.0, 0.0, 1.0] {
        return Err(invalid(format!("the matrix of instance {i} has the last row {last:?}, not 0, 0, 0, 1")));
    }
    Ok((index, [x, y, z]))
}

/// The map of a mesh whose coordinates are less `origin`.
fn affine(rows: &Rows, origin: [f64; 3]) -> Affine {
    let column = |j: usize| rows.map(|row| row[j] as f32);
    let shift = rows.map(|[x, y, z, w]| {
        if origin == NO_ORIGIN { w as f32 } else { (x * origin[0] + y * origin[1] + z * origin[2] + w) as f32 }
    });
    Affine { columns: [column(0), column(1), column(2), shift] }
}
