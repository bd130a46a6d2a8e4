#![expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]

use std::sync::{Arc, PoisonError, RwLock};

use canted::collide::{Pose, each_touching, instance_pairs};
use canted::distance::Overlaps;
use canted::instance::InstanceError;
use canted::kernel::HitLists;
use canted::{Affine, Crossings, Instance, InstanceId, Intersect, Ray, TriangleBvh, TriangleTest};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use crate::arrays::{NO_ORIGIN, Table, matrix, shaped};
use crate::bodies;
use crate::bvh::Bvh;
use crate::error::invalid;
use crate::frame::{self, Near};
use crate::geometry::{self, Geometry};
use crate::hits::Hits;
use crate::names::{self, Inside};
use crate::nearest::{self, Found, Nearest, Wanted, distances, of_points};
use crate::overlaps::{Form, Region, Regions};
use crate::points::{Placed, Surface};
use crate::query::{Columns, RayArrays, Rays, all_hits, closest_hits, occluded};
use crate::work::Call;

type Inner = canted::Tlas<Arc<TriangleBvh>>;

/// Instances of meshes under affine transforms, with ray, containment and distance queries.
///
/// Parameters
/// ----------
/// bvhs : sequence of Bvh
///     The meshes, as they are now: a later refit does not change the Tlas. An origin of a Bvh is part of its transforms. Where one was
///     chosen near a mesh, or an instance is so far away that float32 does not hold it, the Tlas has one near its instances: rays then
///     start near them, in float64, and t and distances of results are float64.
/// instances : sequence of (int, (4, 4) floats), optional
///     For each instance the index of its mesh and world_from_object: points are columns, so the translation is the last column. Any
///     invertible map, rounded to float32 after the origin is subtracted; a scale by zero hides the instance. Default: each mesh once, as it
///     is.
///
/// Raises
/// ------
/// ValueError
///     A mesh that does not exist; a matrix of another shape, with a last row other than 0, 0, 0, 1, that is not finite or too
///     close to singular.
#[pyclass(frozen, weakref, module = "canted")]
pub(crate) struct Tlas {
    /// What queries of a call see, whatever is changed meanwhile.
    place: RwLock<Arc<Scene>>,
}

/// Instances, and what they are instances of.
#[derive(Clone)]
struct Scene {
    tlas: Arc<Inner>,
    geometries: Vec<Arc<Geometry>>,
    /// What is subtracted from coordinates of the caller.
    origin: [f64; 3],
    /// Whether that was chosen near the instances.
    is_near: bool,
}

impl Tlas {
    fn build(
        py: Python<'_>,
        geometries: Vec<Arc<Geometry>>,
        instances: &[Instance],
        (origin, is_near): ([f64; 3], bool),
    ) -> PyResult<Self> {
        let blas = geometries.iter().map(|geometry| Arc::clone(&geometry.mesh)).collect();
        let build = || Inner::new(blas, instances, Default::default());
        let tlas = Call::plain(py)?.run_short(build)?.map_err(invalid)?;
        Ok(Self { place: RwLock::new(Arc::new(Scene { tlas: Arc::new(tlas), geometries, origin, is_near })) })
    }

    /// The scene as it is now.
    fn scene(&self) -> Arc<Scene> {
        Arc::clone(&self.place.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Changes the top level: in place, or a copy of it where a call on another thread refers to it.
    fn edit<R>(&self, change: impl FnOnce(&mut Inner) -> Result<R, InstanceError>) -> PyResult<R> {
        let mut place = self.place.write().unwrap_or_else(PoisonError::into_inner);
        change(Arc::make_mut(&mut Arc::make_mut(&mut place).tlas)).map_err(invalid)
    }
}

impl Scene {
    fn rays<'a>(&self, arrays: &'a RayArrays<'_>) -> Rays<'a> {
        let near = (self.is_near && !self.tlas.aabb().is_empty()).then(|| Near::new(&self.tlas.aabb()));
        arrays.rays(self.origin, near)
    }

    /// The instances that were hit.
    fn surface(&self, columns: &Columns) -> Surface {
        // Negative for a miss.
        let mut ids: Vec<u32> = columns.instance.iter().filter_map(|&id| u32::try_from(id).ok()).collect();
        ids.sort_unstable();
        ids.dedup();
        let placed = |id: u32| {
            let Instance { blas, world_from_object, .. } =
                self.tlas.instance(InstanceId(id)).expect("an instance that was hit");
            Placed { id: InstanceId(id), mesh: Arc::clone(&self.tlas.blas()[blas as usize]), world_from_object }
        };
        let placed = ids.into_iter().map(placed).collect();
        Surface::Tlas { placed, origin: self.origin, is_near: self.is_near }
    }

    /// All hits, or the crossings.
    fn list(&self, call: &Call<'_>, arrays: &RayArrays<'_>, only_crossings: bool) -> PyResult<Hits> {
        let list = |rays: &[Ray], lists: &mut HitLists| match only_crossings {
            true => self.tlas.crossings_listed(rays, lists),
            false => self.tlas.all_hits_listed(rays, lists),
        };
        let columns = all_hits(call, &list, &self.rays(arrays), true)?;
        let surface = self.surface(&columns);
        Hits::new(call.py, columns, surface, arrays.shape())
    }

    /// What inside means for each mesh.
    fn inside(&self, call: &Call<'_>, mode: Option<&str>) -> PyResult<Vec<Inside>> {
        let mode = names::inside(mode)?;
        self.geometries.iter().map(|geometry| geometry::inside(call, geometry, mode)).collect()
    }

    /// Whether a point, relative to the origin, is inside of any instance.
    fn contains_point(&self, point: [f64; 3], modes: &[Inside]) -> bool {
        self.tlas.contains_with(point, |blas, mesh, point| match modes[blas as usize] {
            Inside::Parity => mesh.contains(point),
            Inside::Winding => self.geometries[blas as usize].winding().contains(point),
        })
    }

    /// Nearest triangles of each point.
    fn near<'py>(&self, call: &Call<'py>, points: &Bound<'py, PyAny>, wanted: &Wanted) -> PyResult<Nearest> {
        let points = Table::of_any_shape(points, "points")?;
        nearest::nearest(call, &points, self.origin, wanted, (true, self.is_near), |point, k, max_distance| {
            let mut near = vec![];
            self.tlas.nearest_points(point, k, max_distance, &mut near);
            near.into_iter().map(Found::from).collect()
        })
    }

    /// Triangles that overlap regions.
    fn overlaps<'py>(&self, call: &Call<'py>, (regions, form): (&Regions<'_>, &str)) -> PyResult<Bound<'py, PyAny>> {
        let tlas = &*self.tlas;
        regions.overlaps(call, self.origin, (true, Form::of(form)?), |region, visit| match region {
            Region::Convex(region) => {
                tlas.each_overlapping(region, |(instance, primitive)| visit((instance.0, primitive.0)));
            }
            Region::Sphere { center, radius } => {
                let mut found = vec![];
                tlas.overlapping_sphere(*center, *radius, &mut found);
                let _ = found.into_iter().try_for_each(|(instance, primitive)| visit((instance.0, primitive.0)));
            }
            Region::Hull(hull) => {
                each_touching(tlas, hull, Pose::IDENTITY, |(instance, primitive)| visit((instance.0, primitive.0)));
            }
        })
    }

    /// A matrix of the caller as the transform of an instance of a mesh.
    fn transform(&self, argument: &Bound<'_, PyAny>, index: usize) -> PyResult<Affine> {
        let [x, y, z, last] = matrix(argument, "matrix")?;
        if last != [0.0, 0.0, 0.0, 1.0] {
            return Err(invalid(format!("matrix has the last row {last:?}, not 0, 0, 0, 1")));
        }
        Ok(affine(&[x, y, z], self.geometries[index].origin, self.origin))
    }

    /// An instance by its number, which must not be removed.
    fn instance(&self, number: i64) -> PyResult<(InstanceId, Instance)> {
        let known = u32::try_from(number).ok().map(InstanceId).and_then(|id| Some((id, self.tlas.instance(id)?)));
        match known {
            Some((id, instance)) if !instance.is_removed() => Ok((id, instance)),
            _ => Err(invalid(format!("there is no instance {number}; the Tlas has {}", self.tlas.n_instances()))),
        }
    }
}

#[pymethods]
impl Tlas {
    #[new]
    #[pyo3(signature = (bvhs, instances=None))]
    fn new(py: Python<'_>, bvhs: &Bound<'_, PyAny>, instances: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let geometries = meshes(bvhs)?;
        let mut placed = vec![];
        match instances {
            None => placed.extend((0..geometries.len()).map(|index| (index, IDENTITY))),
            Some(instances) => {
                for (i, instance) in items(instances, "instances")?.enumerate() {
                    placed.push(index_and_matrix(i, &instance?, geometries.len())?);
                }
            }
        }
        let corners: Vec<_> = placed.iter().map(|(index, matrix)| corners(matrix, &geometries[*index])).collect();
        let near = frame::origin_of(corners.iter().flatten().copied());
        let is_near = geometries.iter().any(|geometry| geometry.is_near)
            || near != NO_ORIGIN && corners.iter().any(|corners| frame::is_far(corners));
        let origin = if is_near { near } else { NO_ORIGIN };
        let instances = placed.iter().map(|(index, matrix)| {
            let affine = affine(matrix, geometries[*index].origin, origin);
            Ok(Instance::new(u32::try_from(*index).map_err(invalid)?, affine))
        });
        let instances = instances.collect::<PyResult<Vec<_>>>()?;
        Self::build(py, geometries, &instances, (origin, is_near))
    }

    /// closest_hit(origins, directions, t_min=0, t_max=inf, *, threads=None, progress=None)
    ///
    /// The first hit of each ray, world space: Hits with instance. Of equal t the lowest (instance, triangle) is reported.
    ///
    /// Parameters and errors are those of Bvh.closest_hit; t is in units of the caller's direction.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=None, progress=None))]
    fn closest_hit<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let scene = self.scene();
        let (arrays, call) = (RayArrays::new(origins, directions, [t_min, t_max])?, Call::new(py, threads, progress)?);
        let columns =
            closest_hits(&call, &|_, rays, hits| scene.tlas.closest_hits(rays, hits), &scene.rays(&arrays), true)?;
        let surface = scene.surface(&columns);
        Hits::new(py, columns, surface, arrays.shape())
    }

    /// occluded(origins, directions, t_min=0, t_max=inf, *, threads=None, progress=None)
    ///
    /// Whether each ray hits anything: (...,) bool. Agrees with closest_hit, and is faster.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=None, progress=None))]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let scene = self.scene();
        let (arrays, call) = (RayArrays::new(origins, directions, [t_min, t_max])?, Call::new(py, threads, progress)?);
        shaped(py, occluded(&call, &*scene.tlas, &scene.rays(&arrays))?, arrays.shape(), &[])
    }

    /// all_hits(origins, directions, t_min=0, t_max=inf, *, threads=None, progress=None)
    ///
    /// Every hit of every ray: Hits with instance, one row for each hit, in order of ray, then t, then (instance, triangle).
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=None, progress=None))]
    fn all_hits<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let scene = self.scene();
        scene.list(&Call::new(py, threads, progress)?, &RayArrays::new(origins, directions, [t_min, t_max])?, false)
    }

    /// crossings(origins, directions, t_min=0, t_max=inf, *, threads=None, progress=None)
    ///
    /// Every crossing of a surface once in each instance, also through edges and vertices: Hits with instance, in order of ray, then t. Of
    /// equal t, crossings inward and outward take turns.
    ///
    /// Where faces of two instances coincide, a ray crosses both.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As Bvh.closest_hit, and for a BVH with another triangle test than "watertight".
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=None, progress=None))]
    fn crossings<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let scene = self.scene();
        let mut tests = scene.geometries.iter().map(|geometry| geometry.mesh.test()).enumerate();
        if let Some((i, test)) = tests.find(|(_, test)| *test != TriangleTest::Watertight) {
            return Err(invalid(format!("crossings need triangle_test='watertight'; item {i} of bvhs has '{test}'")));
        }
        scene.list(&Call::new(py, threads, progress)?, &RayArrays::new(origins, directions, [t_min, t_max])?, true)
    }

    /// contains(points, mode=None, *, threads=None, progress=None)
    ///
    /// Whether each point, (..., 3) floats, is inside of any instance or on its surface: (...,) bool.
    ///
    /// mode is that of Bvh.contains, for each mesh by itself. In the space of an instance the point is rounded to float32.
    #[pyo3(signature = (points, mode=None, *, threads=None, progress=None))]
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        mode: Option<&str>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let scene = self.scene();
        let (points, call) = (Table::of_any_shape(points, "points")?, Call::new(py, threads, progress)?);
        let modes = scene.inside(&call, mode)?;
        let inside = of_points(&call, &points.rows(scene.origin), false, |points, inside| {
            let each = points.iter().zip(inside);
            each.for_each(|(&point, inside)| *inside = scene.contains_point(point, &modes));
        })?;
        shaped(py, inside, &points.shape, &[])
    }

    /// nearest(points, max_distance=inf, *, threads=None, progress=None)
    ///
    /// The nearest point of all instances to each point, world space: Nearest with instance. Of equal distances the lowest (instance,
    /// triangle) is reported.
    ///
    /// Distances are exact under any transform. The time grows with the number of instances. Parameters are those of Bvh.nearest.
    #[pyo3(signature = (points, max_distance=f64::INFINITY, *, threads=None, progress=None))]
    fn nearest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        max_distance: f64,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Nearest> {
        let scene = self.scene();
        scene.near(&Call::new(py, threads, progress)?, points, &Wanted::one(max_distance))
    }

    /// k_nearest(points, k, max_distance=inf, *, threads=None, progress=None)
    ///
    /// The k nearest triangles of all instances to each point, nearest first: Nearest with columns of shape (..., k), filled up with inf and
    /// -1. Parameters are those of Bvh.k_nearest.
    #[pyo3(signature = (points, k, max_distance=f64::INFINITY, *, threads=None, progress=None))]
    fn k_nearest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        k: i64,
        max_distance: f64,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Nearest> {
        let scene = self.scene();
        scene.near(&Call::new(py, threads, progress)?, points, &Wanted::some(k, max_distance)?)
    }

    /// signed_distance(points, mode=None, *, threads=None, progress=None)
    ///
    /// Distance of each point, (..., 3) floats, to the nearest surface of any instance, (...,) float32: negative where contains is true with
    /// this mode, inf without triangles, NaN for a point with a NaN. float64 where the origin was chosen.
    #[pyo3(signature = (points, mode=None, *, threads=None, progress=None))]
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        mode: Option<&str>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let scene = self.scene();
        let (points, call) = (Table::of_any_shape(points, "points")?, Call::new(py, threads, progress)?);
        let modes = scene.inside(&call, mode)?;
        let found = of_points(&call, &points.rows(scene.origin), 0.0, |points, found| {
            let mut nearest = vec![None; points.len()];
            scene.tlas.nearest_point_many(points, f64::INFINITY, &mut nearest);
            for ((&point, near), distance) in points.iter().zip(nearest).zip(found) {
                let is_number = !point.iter().any(|x| x.is_nan());
                let size = near.map_or(if is_number { f64::INFINITY } else { f64::NAN }, |near| near.distance);
                *distance = if size > 0.0 && scene.contains_point(point, &modes) { -size } else { size };
            }
        })?;
        distances(py, found, scene.is_near, &points.shape, &[])
    }

    /// overlapping_box(low, high, *, form='all', threads=None, progress=None)
    ///
    /// The triangles that overlap each axis-aligned box of world space, touching included: a dict of region, the index of the box, int64,
    /// instance and primitive, int32, in order of all three. Parameters are those of Bvh.overlapping_box.
    #[pyo3(signature = (low, high, *, form="all", threads=None, progress=None))]
    fn overlapping_box<'py>(
        &self,
        py: Python<'py>,
        low: &Bound<'py, PyAny>,
        high: &Bound<'py, PyAny>,
        form: &str,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let scene = self.scene();
        scene.overlaps(&Call::new(py, threads, progress)?, (&Regions::boxes(low, high)?, form))
    }

    /// overlapping_sphere(center, radius, *, form='all', threads=None, progress=None)
    ///
    /// The triangles at most radius away from each center, world space: a dict as that of overlapping_box.
    #[pyo3(signature = (center, radius, *, form="all", threads=None, progress=None))]
    fn overlapping_sphere<'py>(
        &self,
        py: Python<'py>,
        center: &Bound<'py, PyAny>,
        radius: &Bound<'py, PyAny>,
        form: &str,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let scene = self.scene();
        scene.overlaps(&Call::new(py, threads, progress)?, (&Regions::spheres(center, radius)?, form))
    }

    /// overlapping_frustum(near, far, *, form='all', threads=None, progress=None)
    ///
    /// The triangles that overlap each frustum of world space: a dict as that of overlapping_box. Parameters are those of
    /// Bvh.overlapping_frustum.
    #[pyo3(signature = (near, far, *, form="all", threads=None, progress=None))]
    fn overlapping_frustum<'py>(
        &self,
        py: Python<'py>,
        near: &Bound<'py, PyAny>,
        far: &Bound<'py, PyAny>,
        form: &str,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let scene = self.scene();
        scene.overlaps(&Call::new(py, threads, progress)?, (&Regions::frusta(near, far)?, form))
    }

    /// overlapping_hull(points, radius=0, *, form='all', threads=None, progress=None)
    ///
    /// The triangles that overlap what is within a radius of the convex hull of some points of world space: a dict as that of overlapping_box.
    /// Parameters are those of Bvh.overlapping_hull.
    #[pyo3(signature = (points, radius=None, *, form="all", threads=None, progress=None))]
    fn overlapping_hull<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        radius: Option<&Bound<'py, PyAny>>,
        form: &str,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.scene().overlaps(&Call::new(py, threads, progress)?, (&Regions::hulls(points, radius)?, form))
    }

    /// winding_number(points, tolerance=1e-6, *, threads=None, progress=None)
    ///
    /// How often the surfaces of all instances wind around each point: (...,) float64, the sum of those of the instances, of which mirrored ones count
    /// negatively. NaN for a point that is not finite.
    ///
    /// Closed meshes have the same number under any matrix. That of a mesh with a border is exact where the matrix rotates, mirrors and scales all axes alike; else it is the
    /// number in the space of the mesh. The time grows with the number of instances. tolerance is that of Bvh.winding_number, for each instance.
    #[pyo3(signature = (points, tolerance=1e-6, *, threads=None, progress=None))]
    fn winding_number<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        tolerance: f64,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        if tolerance.is_nan() || tolerance < 0.0 {
            return Err(invalid(format!("tolerance is {tolerance}; use a number of 0 or more")));
        }
        let (points, call, scene) =
            (Table::of_any_shape(points, "points")?, Call::new(py, threads, progress)?, self.scene());
        let numbers = of_points(&call, &points.rows(scene.origin), f64::NAN, |points, numbers| {
            for (&point, number) in points.iter().zip(numbers) {
                *number = scene.tlas.winding_number_with(point, |blas, _, point| {
                    scene.geometries[blas as usize].winding().number(point, tolerance)
                });
            }
        })?;
        shaped(py, numbers, &points.shape, &[])
    }

    /// instance_pairs()
    ///
    /// The pairs of instances whose surfaces share a point, touching included: (n, 2) int32, the lower one first, sorted by row. Decided as Bvh.pairs, for
    /// vertices that the matrices of both map to world space in float64. Hidden and removed instances touch nothing.
    fn instance_pairs(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let scene = self.scene();
        let found = Call::plain(py)?.run(move || {
            let mut found = vec![];
            instance_pairs(&*scene.tlas, &mut found);
            found
        })?;
        bodies::numbers(py, found.iter().map(|pair| pair.map(|instance| instance.0)))
    }

    /// insert(index, matrix)
    ///
    /// Adds an instance of the mesh bvhs[index] under world_from_object, (4, 4) floats; returns its number. That of a removed instance is used again.
    ///
    /// This and the other changes cost a few microseconds, whatever the number of instances. Hits found before stay as they are. The origin stays.
    fn insert(&self, index: i64, matrix: &Bound<'_, PyAny>) -> PyResult<u32> {
        let scene = self.scene();
        let n = scene.geometries.len();
        let known = usize::try_from(index).ok().filter(|&index| index < n);
        let known = known.ok_or_else(|| invalid(format!("there is no BVH {index}; the list bvhs has {n}")))?;
        let instance = Instance::new(u32::try_from(known).map_err(invalid)?, scene.transform(matrix, known)?);
        drop(scene);
        Ok(self.edit(|tlas| tlas.insert(instance))?.0)
    }

    /// remove(instance)
    ///
    /// Removes an instance; the others keep their numbers.
    fn remove(&self, instance: i64) -> PyResult<()> {
        let (id, _) = self.scene().instance(instance)?;
        self.edit(|tlas| tlas.remove(id).map(drop))
    }

    /// set_transform(instance, matrix)
    ///
    /// Moves an instance: matrix is the new world_from_object, (4, 4) floats; a scale by zero hides it.
    fn set_transform(&self, instance: i64, matrix: &Bound<'_, PyAny>) -> PyResult<()> {
        let scene = self.scene();
        let (id, known) = scene.instance(instance)?;
        let new = scene.transform(matrix, known.blas as usize)?;
        drop(scene);
        self.edit(|tlas| tlas.set_transform(id, new))
    }

    /// set_mask(instance, mask)
    ///
    /// Hides an instance from all queries with the mask 0, and shows it with any other integer of 32 bits.
    fn set_mask(&self, instance: i64, mask: i64) -> PyResult<()> {
        let (id, _) = self.scene().instance(instance)?;
        let mask = u32::try_from(mask).map_err(|_| invalid(format!("mask is {mask}; use 0 to 2^32 - 1")))?;
        self.edit(|tlas| tlas.set_mask(id, mask))
    }

    #[classmethod]
    fn _of_parts(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        bvhs: &Bound<'_, PyAny>,
        instances: Vec<(u32, Vec<f32>, u32)>,
        origin: [f64; 3],
        is_near: bool,
    ) -> PyResult<Self> {
        let instances = instances.into_iter().map(|(blas, columns, mask)| match columns.as_chunks::<3>().0 {
            &[x, y, z, w] => Ok(Instance::new(blas, Affine { columns: [x, y, z, w] }).with_mask(mask)),
            _ => Err(invalid(format!("an instance has {} numbers, not 12", columns.len()))),
        });
        let instances = instances.collect::<PyResult<Vec<_>>>()?;
        if !origin.iter().all(|x| x.is_finite()) {
            return Err(invalid(format!("origin {origin:?} is not finite")));
        }
        Self::build(py, meshes(bvhs)?, &instances, (origin, is_near))
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let scene = self.scene();
        let bvhs = scene.geometries.iter().map(|geometry| Py::new(py, Bvh::shared(Arc::clone(geometry))));
        let instances = (0..scene.tlas.n_numbers() as u32)
            .filter_map(|i| scene.tlas.instance(InstanceId(i)))
            .map(|instance| (instance.blas, instance.world_from_object.columns.as_flattened().to_vec(), instance.mask));
        let (bvhs, instances) = (bvhs.collect::<PyResult<Vec<_>>>()?, instances.collect::<Vec<_>>());
        let parts = (bvhs, instances, scene.origin, scene.is_near).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of_parts")?, parts))
    }

    /// stats()
    ///
    /// Numbers about the Tlas, as a dict: bvhs, instances, triangles (of each mesh once), bytes (of the top level), origin.
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let scene = self.scene();
        let stats = PyDict::new(py);
        stats.set_item("bvhs", scene.tlas.blas().len())?;
        stats.set_item("instances", scene.tlas.n_instances())?;
        stats.set_item("triangles", scene.tlas.blas().iter().map(|mesh| mesh.n_primitives()).sum::<usize>())?;
        stats.set_item("bytes", scene.tlas.n_bytes())?;
        stats.set_item("origin", self.origin())?;
        Ok(stats)
    }

    /// The least and the greatest coordinates, (2, 3) float64, world space; None without instances of meshes that have triangles.
    #[getter]
    fn bounds(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        let scene = self.scene();
        let aabb = scene.tlas.aabb();
        if aabb.is_empty() {
            return Ok(None);
        }
        let given = |end: [f32; 3]| -> [f64; 3] { std::array::from_fn(|k| f64::from(end[k]) + scene.origin[k]) };
        Ok(Some(shaped(py, [given(aabb.min), given(aabb.max)].as_flattened().to_vec(), &[2], &[3])?))
    }

    /// What is subtracted from coordinates, as a tuple of three floats.
    #[getter]
    fn origin(&self) -> (f64, f64, f64) {
        let scene = self.scene();
        scene.origin.into()
    }

    fn __len__(&self) -> usize {
        let scene = self.scene();
        scene.tlas.n_instances()
    }

    fn __bool__(&self) -> bool {
        true
    }

    fn __repr__(&self) -> String {
        let scene = self.scene();
        format!("Tlas({} instances of {} meshes)", scene.tlas.n_instances(), scene.tlas.blas().len())
    }
}

/// Rows of a map to world space, translations last.
type Rows4 = [[f64; 4]; 3];

const IDENTITY: Rows4 = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// The meshes of a sequence of BVHs, as they are now.
fn meshes(bvhs: &Bound<'_, PyAny>) -> PyResult<Vec<Arc<Geometry>>> {
    let of_item = |(i, bvh): (usize, PyResult<Bound<'_, PyAny>>)| {
        let bvh = bvh?;
        let bvh = bvh.cast::<Bvh>().map_err(|_| invalid(format!("item {i} of bvhs is not a Bvh")))?;
        Ok(bvh.get().geometry())
    };
    items(bvhs, "bvhs")?.enumerate().map(of_item).collect()
}

/// The items of a sequence.
fn items<'py>(
    argument: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<impl Iterator<Item = PyResult<Bound<'py, PyAny>>> + use<'py>> {
    argument.try_iter().map_err(|_| invalid(format!("{name} is not a sequence")))
}

/// One item of `instances`.
fn index_and_matrix(i: usize, instance: &Bound<'_, PyAny>, n_meshes: usize) -> PyResult<(usize, Rows4)> {
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

/// The map of a mesh whose coordinates are less `from`, to a space whose coordinates are less `to`.
fn affine(rows: &Rows4, from: [f64; 3], to: [f64; 3]) -> Affine {
    let column = |j: usize| rows.map(|row| row[j] as f32);
    let shift: [f64; 3] = std::array::from_fn(|k| {
        let [x, y, z, w] = rows[k];
        if from == NO_ORIGIN && to == NO_ORIGIN { w } else { x * from[0] + y * from[1] + z * from[2] + w - to[k] }
    });
    Affine { columns: [column(0), column(1), column(2), shift.map(|x| x as f32)] }
}

/// The corners of a placed mesh, world space.
fn corners(rows: &Rows4, geometry: &Geometry) -> Vec<[f64; 3]> {
    let Some(bounds) = geometry.bounds() else { return vec![] };
    let corner = |i: usize| [0, 1, 2].map(|k| bounds[i >> k & 1][k]);
    let image = |p: [f64; 3]| rows.map(|[x, y, z, w]| x * p[0] + y * p[1] + z * p[2] + w);
    (0..8).map(|i| image(corner(i))).collect()
}
