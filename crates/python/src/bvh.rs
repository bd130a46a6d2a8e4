#![expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]

use std::path::PathBuf;
use std::sync::{Arc, PoisonError, RwLock};

use canted::collide::{Pose, each_pair};
use canted::distance::Overlaps;
use canted::kernel::HitLists;
use canted::{Config, Crossings, Intersect, Ray, TriangleTest};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyType};

use crate::arrays::{Table, shaped};
use crate::bodies::{self, Contact, Distance, Pair};
use crate::error::invalid;
use crate::file;
use crate::frame::OriginArgument;
use crate::geometry::{self, Geometry};
use crate::hits::Hits;
use crate::names::{self, Inside};
use crate::nearest::{self, Nearest, Wanted, distances, of_points, rounded};
use crate::overlaps::{Form, Region, Regions};
use crate::points::Surface;
use crate::query::{RayArrays, all_hits, closest_hits, occluded};
use crate::work::Call;

/// A bounding volume hierarchy over a triangle mesh: ray, containment and distance queries.
///
/// Every answer is that of a loop over all triangles: no hit is lost at edges and vertices, and there is no epsilon.
///
/// Parameters
/// ----------
/// vertices : (n, 3) float32 or float64, or a mesh
///     Finite coordinates. Triangles use float32: float64 is rounded once, to nearest, after origin is subtracted. Without triangles: a mesh
///     of trimesh or Open3D (legacy or tensor), or an array of shape (m, 3, 3), the three vertices of each triangle. Arrays are copied.
/// triangles : (m, 3) integers, optional
///     Vertex indices from 0.
/// preset : "dynamic", "fast", "balanced" or "quality"
///     How much build time is spent on how fast a BVH. Answers do not depend on it.
/// triangle_test : "watertight", "moller-trumbore" or "baldwin-weber"
///     Only watertight has no leaks between triangles, and crossings.
/// aligned : bool
///     Builds without oriented nodes, to compare. Answers do not depend on it.
/// origin : "auto", "near", (3,) floats or None
///     Subtracted in float64 from vertices, and from origins and points of queries; added to positions of results. None: nothing. "near": a
///     point near the mesh; rays then start near it, in float64, and t and distances of results are float64. "auto": as "near" where
///     rounding to float32 would move a vertex by more than 1e-4 of the smallest edge, else None.
/// threads : int, optional
///     Threads of the build, 1 to 1024. Default: all processors.
/// progress : function, optional
///     Called with 0 several times a second, and with 1 at the end; an exception that it raises ends the build.
///
/// Raises
/// ------
/// ValueError
///     Wrong shapes or types; the first triangle with an index out of range or a vertex that is not finite.
#[pyclass(frozen, weakref, module = "canted")]
pub(crate) struct Bvh {
    geometry: RwLock<Arc<Geometry>>,
}

impl Bvh {
    /// The mesh as it is now.
    pub(crate) fn geometry(&self) -> Arc<Geometry> {
        self.geometry.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(crate) fn of(geometry: Geometry) -> Self {
        Self::shared(Arc::new(geometry))
    }

    pub(crate) fn shared(geometry: Arc<Geometry>) -> Self {
        Self { geometry: RwLock::new(geometry) }
    }
}

/// The arguments of ray queries, as Python passes them.
struct RayCall<'a, 'py> {
    origins: &'a Bound<'py, PyAny>,
    directions: &'a Bound<'py, PyAny>,
    interval: [Option<&'a Bound<'py, PyAny>>; 2],
    origin: Option<&'a Bound<'py, PyAny>>,
    call: Call<'py>,
}

/// The options of a build, as Python passes them.
struct Options<'a, 'py> {
    preset: &'a str,
    triangle_test: &'a str,
    aligned: bool,
    origin: OriginArgument<'py>,
}

impl Bvh {
    /// Builds a BVH; without triangles, `vertices` is a mesh.
    fn build<'py>(
        call: &Call<'py>,
        vertices: &Bound<'py, PyAny>,
        triangles: Option<&Bound<'py, PyAny>>,
        options: &Options<'_, 'py>,
    ) -> PyResult<Self> {
        let (preset, test) = (names::preset(options.preset)?, names::triangle_test(options.triangle_test)?);
        let config = Config { test, ..Config::preset(preset) };
        let config = if options.aligned { config.axis_aligned() } else { config };
        let origin = options.origin.read()?;
        let arrays = match triangles {
            Some(triangles) => (vertices.clone(), triangles.clone()),
            None => call.py.import("canted.mesh")?.call_method1("arrays_of", (vertices,))?.extract()?,
        };
        Ok(Self::of(geometry::build(call, config, preset, (&arrays.0, &arrays.1), origin)?))
    }

    /// All hits, or the crossings.
    fn list(&self, rays: &RayCall<'_, '_>, only_crossings: bool) -> PyResult<Hits> {
        let (geometry, call) = (self.geometry(), &rays.call);
        let origin = geometry.origin(rays.origin)?;
        let arrays = RayArrays::new(rays.origins, rays.directions, rays.interval)?;
        let mesh = &*geometry.mesh;
        if only_crossings && mesh.test() != TriangleTest::Watertight {
            let test = mesh.test();
            return Err(invalid(format!("crossings need triangle_test='watertight'; this BVH has '{test}'")));
        }
        let list = |rays: &[Ray], lists: &mut HitLists| match only_crossings {
            true => mesh.crossings_listed(rays, lists),
            false => mesh.all_hits_listed(rays, lists),
        };
        let columns = all_hits(call, &list, &arrays.rays(origin, geometry.near()), false)?;
        Hits::new(call.py, columns, Surface::Mesh { geometry, origin }, arrays.shape())
    }

    /// Nearest triangles of each point.
    fn near<'py>(
        &self,
        call: &Call<'py>,
        points: &Bound<'py, PyAny>,
        wanted: &Wanted,
        origin: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Nearest> {
        let (geometry, points) = (self.geometry(), Table::of_any_shape(points, "points")?);
        let origin = geometry.origin(origin)?;
        nearest::nearest(call, &points, origin, wanted, (false, geometry.is_near), |point, k, max_distance| {
            nearest::of_mesh(&geometry, point, k, max_distance)
        })
    }

    /// Triangles that overlap regions.
    fn overlaps<'py>(
        &self,
        call: &Call<'py>,
        (regions, form): (&Regions<'_>, &str),
        origin: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let geometry = self.geometry();
        let mesh = &*geometry.mesh;
        regions.overlaps(call, geometry.origin(origin)?, (false, Form::of(form)?), |region, visit| match region {
            Region::Convex(region) => mesh.each_overlapping(region, |primitive| visit((0, primitive.0))),
            Region::Sphere { center, radius } => {
                let mut found = vec![];
                mesh.overlapping_sphere(center.map(|x| x as f32), *radius as f32, &mut found);
                let _ = found.into_iter().try_for_each(|primitive| visit((0, primitive.0)));
            }
            Region::Hull(hull) => {
                each_pair(mesh, Pose::IDENTITY, hull, Pose::IDENTITY, |[primitive, _]| visit((0, primitive.0)));
            }
        })
    }
}

#[pymethods]
impl Bvh {
    #[new]
    #[pyo3(
        signature = (vertices, triangles=None, preset="balanced", triangle_test="watertight", *, aligned=false, origin=OriginArgument::auto(), threads=None, progress=None),
        text_signature = "(vertices, triangles=None, preset='balanced', triangle_test='watertight', *, aligned=False, origin='auto', threads=None, progress=None)"
    )]
    fn new<'py>(
        py: Python<'py>,
        vertices: &Bound<'py, PyAny>,
        triangles: Option<&Bound<'py, PyAny>>,
        preset: &str,
        triangle_test: &str,
        aligned: bool,
        origin: OriginArgument<'py>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let options = Options { preset, triangle_test, aligned, origin };
        Self::build(&Call::new(py, threads, progress)?, vertices, triangles, &options)
    }

    /// from_mesh(mesh, preset='balanced', triangle_test='watertight', *, aligned=False, origin='auto', threads=None, progress=None)
    ///
    /// The BVH of a mesh of trimesh (a scene included) or Open3D (legacy or tensor), or of an array of shape (m, 3, 3): as Bvh(mesh).
    #[staticmethod]
    #[pyo3(
        signature = (mesh, preset="balanced", triangle_test="watertight", *, aligned=false, origin=OriginArgument::auto(), threads=None, progress=None),
        text_signature = "(mesh, preset='balanced', triangle_test='watertight', *, aligned=False, origin='auto', threads=None, progress=None)"
    )]
    fn from_mesh<'py>(
        py: Python<'py>,
        mesh: &Bound<'py, PyAny>,
        preset: &str,
        triangle_test: &str,
        aligned: bool,
        origin: OriginArgument<'py>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let options = Options { preset, triangle_test, aligned, origin };
        Self::build(&Call::new(py, threads, progress)?, mesh, None, &options)
    }

    /// closest_hit(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// The first hit of each ray.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : (..., 3) floats
    ///     Rays of any shape, such as (n, 3) or (h, w, 3); a ray of shape (3,) counts as n = 1. One origin or direction of shape (3,) serves
    ///     all. Directions may have any length but zero. float64 is rounded to float32, origins after the BVH's origin is subtracted.
    /// t_min, t_max : float or (...,) floats
    ///     The closed interval of t, in units of the direction.
    /// origin : (3,) floats, optional
    ///     Subtracted from origins in float64. Default: that of the BVH.
    /// threads : int, optional
    ///     1 to 1024. Default: all processors.
    /// progress : function, optional
    ///     Called with the finished fraction several times a second, and with 1 at the end; an exception that it raises ends the query.
    ///
    /// Returns
    /// -------
    /// Hits
    ///     One row for each ray, in the shape of the rays. A ray with a NaN, an infinite origin or direction, a zero direction, a negative
    ///     t_min or an empty interval never hits, nor does one that would reach a triangle only beyond the greatest float32. Of equal t the
    ///     lowest triangle is reported.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Wrong shapes or types, or different numbers of origins and directions.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    fn closest_hit<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let (geometry, call) = (self.geometry(), Call::new(py, threads, progress)?);
        let origin = geometry.origin(origin)?;
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let (mesh, rays) = (&*geometry.mesh, arrays.rays(origin, geometry.near()));
        let columns = closest_hits(&call, &|_, rays, hits| mesh.closest_hits(rays, hits), &rays, false)?;
        Hits::new(py, columns, Surface::Mesh { geometry, origin }, arrays.shape())
    }

    /// occluded(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// Whether each ray hits anything: (...,) bool. Agrees with closest_hit, whose parameters and errors it has, and is faster.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let (geometry, call) = (self.geometry(), Call::new(py, threads, progress)?);
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let found = occluded(&call, &*geometry.mesh, &arrays.rays(geometry.origin(origin)?, geometry.near()))?;
        shaped(py, found, arrays.shape(), &[])
    }

    /// all_hits(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// Every hit of every ray: Hits with one row for each hit, in order of ray, then t, then triangle.
    ///
    /// Each triangle appears once for a ray, and all triangles around an edge or a vertex that a ray passes through appear;
    /// crossings counts surfaces instead. Parameters and errors are those of closest_hit.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    fn all_hits<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let call = Call::new(py, threads, progress)?;
        self.list(&RayCall { origins, directions, interval: [t_min, t_max], origin, call }, false)
    }

    /// crossings(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// Every crossing of a surface once, also through edges and vertices: Hits in order of ray, then t. Of equal t, crossings inward and
    /// outward take turns.
    ///
    /// entering says whether a ray enters a solid, whose triangles run counter-clockwise as seen from outside. A ray that starts
    /// and ends outside of a closed mesh enters it as often as it leaves. Where a ray touches a silhouette without crossing,
    /// nothing is reported. Parameters are those of closest_hit.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As closest_hit, and for a BVH with another triangle test than "watertight".
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    fn crossings<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let call = Call::new(py, threads, progress)?;
        self.list(&RayCall { origins, directions, interval: [t_min, t_max], origin, call }, true)
    }

    /// contains(points, mode=None, *, origin=None, threads=None, progress=None)
    ///
    /// Whether each point is inside of a mesh or on its surface: (...,) bool.
    ///
    /// Parameters
    /// ----------
    /// points : (..., 3) floats
    ///     float64 is rounded to float32 after origin is subtracted. A point that is not finite is outside.
    /// mode : "winding", "parity" or None
    ///     "winding": whether the winding number exceeds 1/2, with either sign. Inside of solids that overlap, of doubled faces and of scans
    ///     with holes. Neighboring triangles must agree in orientation, and the surface of a hollow must face the other way.
    ///     "parity": whether a ray crosses the surface an odd number of times, exact for every point of a closed mesh. Nested surfaces
    ///     alternate: a hollow in a solid is outside, and so is what two solids have in common. The orientation of triangles does not matter.
    ///     None: "winding", or "parity" for a mesh in which neighbors disagree in orientation.
    #[pyo3(signature = (points, mode=None, *, origin=None, threads=None, progress=None))]
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        mode: Option<&str>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let (geometry, call) = (self.geometry(), Call::new(py, threads, progress)?);
        let (mode, points) = (names::inside(mode)?, Table::of_any_shape(points, "points")?);
        let origin = geometry.origin(origin)?;
        let mode = geometry::inside(&call, &geometry, mode)?;
        let inside = of_points(&call, &points.rows(origin), false, |points, inside| match mode {
            Inside::Parity => geometry.mesh.contains_many(&rounded(points), inside),
            Inside::Winding => geometry.winding().contains_many(&rounded(points), inside),
        })?;
        shaped(py, inside, &points.shape, &[])
    }

    /// winding_number(points, tolerance=1e-6, *, origin=None, threads=None, progress=None)
    ///
    /// How often the surface winds around each point, (...,) float64: 1 inside of a closed mesh, 0 outside, 2 where two solids overlap, a
    /// fraction near the border of an open one, 1/2 on a flat face; NaN for a point that is not finite.
    ///
    /// It is the sum of the solid angles of all triangles over 4 pi, counterclockwise ones seen from outside being positive.
    ///
    /// Parameters
    /// ----------
    /// points : (..., 3) floats
    ///     float64 is rounded to float32 after origin is subtracted.
    /// tolerance : float
    ///     The numbers are off by at most this, apart from roundings of float64; with 0, each triangle is summed, as it is for meshes of up
    ///     to 64 triangles.
    #[pyo3(signature = (points, tolerance=1e-6, *, origin=None, threads=None, progress=None))]
    fn winding_number<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        tolerance: f64,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let (geometry, call) = (self.geometry(), Call::new(py, threads, progress)?);
        if tolerance.is_nan() || tolerance < 0.0 {
            return Err(invalid(format!("tolerance is {tolerance}; use 0 or more")));
        }
        let points = Table::of_any_shape(points, "points")?;
        let origin = geometry.origin(origin)?;
        geometry::inside(&call, &geometry, Some(Inside::Winding))?;
        let numbers = of_points(&call, &points.rows(origin), 0.0, |points, numbers| {
            geometry.winding().numbers(&rounded(points), tolerance, numbers);
        })?;
        shaped(py, numbers, &points.shape, &[])
    }

    /// nearest(points, max_distance=inf, *, origin=None, threads=None, progress=None)
    ///
    /// The nearest point of the mesh to each point: Nearest.
    ///
    /// Parameters
    /// ----------
    /// points : (..., 3) floats
    ///     float64 is rounded to float32 after origin is subtracted.
    /// max_distance : float
    ///     Triangles farther away are not found; nothing is found for a negative one.
    #[pyo3(signature = (points, max_distance=f64::INFINITY, *, origin=None, threads=None, progress=None))]
    fn nearest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        max_distance: f64,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Nearest> {
        self.near(&Call::new(py, threads, progress)?, points, &Wanted::one(max_distance), origin)
    }

    /// k_nearest(points, k, max_distance=inf, *, origin=None, threads=None, progress=None)
    ///
    /// The k nearest triangles to each point, nearest first: Nearest with columns of shape (..., k), filled up with inf and -1.
    ///
    /// Parameters
    /// ----------
    /// points : (..., 3) floats
    ///     float64 is rounded to float32 after origin is subtracted.
    /// k : int
    ///     1 or more.
    /// max_distance : float
    ///     Triangles farther away are not found.
    #[pyo3(signature = (points, k, max_distance=f64::INFINITY, *, origin=None, threads=None, progress=None))]
    fn k_nearest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        k: i64,
        max_distance: f64,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Nearest> {
        self.near(&Call::new(py, threads, progress)?, points, &Wanted::some(k, max_distance)?, origin)
    }

    /// signed_distance(points, mode=None, *, origin=None, threads=None, progress=None)
    ///
    /// Distance of each point to the surface of a mesh, (...,) float32: negative where contains is true with this mode, zero exactly on the
    /// surface, inf for an empty mesh, NaN for a point with a NaN. float64 for a mesh whose origin was chosen near it.
    #[pyo3(signature = (points, mode=None, *, origin=None, threads=None, progress=None))]
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        mode: Option<&str>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let (geometry, call) = (self.geometry(), Call::new(py, threads, progress)?);
        let (mode, points) = (names::inside(mode)?, Table::of_any_shape(points, "points")?);
        let origin = geometry.origin(origin)?;
        let mode = geometry::inside(&call, &geometry, mode)?;
        let found = of_points(&call, &points.rows(origin), 0.0, |points, found| {
            let (rounded, mut signed) = (rounded(points), vec![0.0; points.len()]);
            match mode {
                Inside::Parity => geometry.mesh.signed_distance_many(&rounded, &mut signed),
                Inside::Winding => {
                    geometry.winding().signed_distance_many(&geometry.mesh, &rounded, &mut signed);
                }
            }
            for ((&point, signed), distance) in points.iter().zip(signed).zip(found) {
                *distance = f64::from(signed);
                // Its size by the point that is not rounded.
                let is_inexact = geometry.is_near && signed.is_finite() && signed != 0.0;
                if let Some(near) = is_inexact.then(|| nearest::of_mesh(&geometry, point, 1, f64::INFINITY)) {
                    *distance = near.first().map_or(*distance, |near| near.distance.copysign(*distance));
                }
            }
        })?;
        distances(py, found, geometry.is_near, &points.shape, &[])
    }

    /// overlapping_box(low, high, *, form='all', origin=None, threads=None, progress=None)
    ///
    /// The triangles that overlap each axis-aligned box, touching included: a dict of region, the index of the box, int64, and primitive,
    /// int32, in order of both.
    ///
    /// No overlap is missed; a gap below 2^-46 of the coordinates may be reported as an overlap. A box from inf to -inf is empty and overlaps nothing;
    /// another one whose low exceeds its high is an error.
    ///
    /// Parameters
    /// ----------
    /// low, high : (..., 3) floats
    ///     The corners of the boxes. float64 is rounded to float32 after origin is subtracted.
    /// form : str
    ///     "all"; "any" for (...,) bool, "count" for (...,) int64, or "first" for a dict of the lowest primitive, (...,) int32, -1 where there is none.
    #[pyo3(signature = (low, high, *, form="all", origin=None, threads=None, progress=None))]
    fn overlapping_box<'py>(
        &self,
        py: Python<'py>,
        low: &Bound<'py, PyAny>,
        high: &Bound<'py, PyAny>,
        form: &str,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.overlaps(&Call::new(py, threads, progress)?, (&Regions::boxes(low, high)?, form), origin)
    }

    /// overlapping_sphere(center, radius, *, form='all', origin=None, threads=None, progress=None)
    ///
    /// The triangles at most radius away from each center: a dict as that of overlapping_box.
    ///
    /// Parameters
    /// ----------
    /// center : (..., 3) floats
    ///     float64 is rounded to float32 after origin is subtracted.
    /// radius : float or (...,) floats
    ///     Nothing overlaps a sphere with a negative one.
    #[pyo3(signature = (center, radius, *, form="all", origin=None, threads=None, progress=None))]
    fn overlapping_sphere<'py>(
        &self,
        py: Python<'py>,
        center: &Bound<'py, PyAny>,
        radius: &Bound<'py, PyAny>,
        form: &str,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.overlaps(&Call::new(py, threads, progress)?, (&Regions::spheres(center, radius)?, form), origin)
    }

    /// overlapping_frustum(near, far, *, form='all', origin=None, threads=None, progress=None)
    ///
    /// The triangles that overlap each frustum, or any convex solid with six flat faces: a dict as that of overlapping_box.
    ///
    /// Parameters
    /// ----------
    /// near, far : (..., 4, 3) floats
    ///     The corners of the near face in order around it, and those of the far face in the same order; corners may coincide.
    #[pyo3(signature = (near, far, *, form="all", origin=None, threads=None, progress=None))]
    fn overlapping_frustum<'py>(
        &self,
        py: Python<'py>,
        near: &Bound<'py, PyAny>,
        far: &Bound<'py, PyAny>,
        form: &str,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.overlaps(&Call::new(py, threads, progress)?, (&Regions::frusta(near, far)?, form), origin)
    }

    /// overlapping_hull(points, radius=0, *, form='all', origin=None, threads=None, progress=None)
    ///
    /// The triangles that overlap what is within a radius of the hull of points: a capsule for two points, an oriented box for eight. A gap below
    /// 2^-40 of the coordinates may be reported as an overlap.
    ///
    /// Parameters
    /// ----------
    /// points : (..., k, 3) floats
    ///     The k points of each hull, in any order.
    /// radius : float or (...,) floats
    ///     0 or more.
    #[pyo3(signature = (points, radius=None, *, form="all", origin=None, threads=None, progress=None))]
    fn overlapping_hull<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        radius: Option<&Bound<'py, PyAny>>,
        form: &str,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.overlaps(&Call::new(py, threads, progress)?, (&Regions::hulls(points, radius)?, form), origin)
    }

    /// pairs(b, pose=None)
    ///
    /// The pairs of triangles of this mesh and of b that share a point, touching included: (n, 2) int32, sorted by row.
    ///
    /// Decided exactly, for degenerate and coplanar triangles too: a degenerate one is the segment or the point that its vertices span. Vertices are
    /// the float32 ones of both meshes; those of b are mapped by pose in float64, rounded there.
    ///
    /// Parameters
    /// ----------
    /// b : Bvh
    ///     The other mesh.
    /// pose : (4, 4) floats, optional
    ///     Places b in the space of this mesh: rotated, scaled, mirrored or sheared. Default: both are in one space.
    #[pyo3(signature = (b, pose=None))]
    fn pairs(&self, py: Python<'_>, b: &Self, pose: Option<&Bound<'_, PyAny>>) -> PyResult<Py<PyAny>> {
        Pair::new(self.geometry(), b.geometry(), pose)?.pairs(&Call::plain(py)?)
    }

    /// overlaps(b, pose=None)
    ///
    /// Whether a triangle of this mesh and one of b share a point: bool. Parameters and what is exact are those of pairs. A mesh inside of a closed
    /// one does not overlap it, unless surfaces touch; contains of one of its vertices tells.
    #[pyo3(name = "overlaps", signature = (b, pose=None))]
    fn overlaps_mesh(&self, py: Python<'_>, b: &Self, pose: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
        Pair::new(self.geometry(), b.geometry(), pose)?.overlaps(&Call::plain(py)?)
    }

    /// distance_to(b, pose=None)
    ///
    /// The distance of the surfaces of this mesh and of b, and their nearest points: Distance. 0 where overlaps is true. Parameters are those of
    /// pairs.
    #[pyo3(signature = (b, pose=None))]
    fn distance_to(&self, py: Python<'_>, b: &Self, pose: Option<&Bound<'_, PyAny>>) -> PyResult<Distance> {
        Pair::new(self.geometry(), b.geometry(), pose)?.distance(&Call::plain(py)?)
    }

    /// self_intersections()
    ///
    /// The pairs of triangles of this mesh that share a point, (n, 2) int32, the lower triangle first, sorted by row.
    ///
    /// Neighbors are not reported: pairs with one or two vertices at one place, whatever their indices. Two triangles with the same three vertices are.
    fn self_intersections(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        bodies::self_intersections(&Call::plain(py)?, self.geometry())
    }

    /// cast_sphere(origins, directions, radius, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// The first contact of a sphere whose center moves along each ray, touching included: Hits.
    ///
    /// t is when the sphere touches, in units of the direction, 0 where it overlaps at the start; position the point of the triangle that is touched. A zero
    /// direction is a sphere at rest. Other parameters and errors are those of closest_hit.
    ///
    /// Parameters
    /// ----------
    /// radius : float or (...,) floats
    ///     0 or more.
    #[pyo3(signature = (origins, directions, radius, t_max=None, *, origin=None, threads=None, progress=None))]
    fn cast_sphere<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        radius: &Bound<'py, PyAny>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let (geometry, call) = (self.geometry(), Call::new(py, threads, progress)?);
        let (origin, arrays) = (geometry.origin(origin)?, RayArrays::new(origins, directions, [None, t_max])?);
        bodies::cast_sphere(&call, geometry, &arrays, radius, origin)
    }

    /// cast(b, motion, pose=None, t_max=inf)
    ///
    /// The first contact of b, which moves by t times motion, with this mesh at rest, touching included: Contact, or None without one.
    ///
    /// Parameters
    /// ----------
    /// b, motion : Bvh, (3,) floats
    ///     The mesh that moves, and its way in the time 1, in the space of this mesh. pose is that of pairs: where b is at the start.
    #[pyo3(signature = (b, motion, pose=None, t_max=f64::INFINITY))]
    fn cast(
        &self,
        py: Python<'_>,
        b: &Self,
        motion: [f64; 3],
        pose: Option<&Bound<'_, PyAny>>,
        t_max: f64,
    ) -> PyResult<Option<Contact>> {
        Pair::new(self.geometry(), b.geometry(), pose)?.cast(&Call::plain(py)?, motion, t_max)
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
        let refit = geometry::refit(&Call::new(py, threads, None)?, &self.geometry, vertices)?;
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
        Call::plain(py)?.run(move || file::save(&path, &geometry))?
    }

    /// load(path, mmap=False)
    ///
    /// The BVH that save wrote, or the Rust library (WideBvh::to_bytes of triangles): a watertight one, which has no refit. With mmap, rays are traced from
    /// the pages of the file, which is checked once and must not be written or truncated meanwhile: rename another file onto it, as save does.
    ///
    /// Raises
    /// ------
    /// OSError, ValueError
    ///     The file cannot be read; it is not a BVH, or is damaged.
    #[staticmethod]
    #[pyo3(signature = (path, mmap=false), text_signature = "(path, mmap=False)")]
    fn load(py: Python<'_>, path: PathBuf, mmap: bool) -> PyResult<Self> {
        Ok(Self::of(Call::plain(py)?.run(move || if mmap { file::map(&path) } else { file::load(&path) })??))
    }

    #[classmethod]
    fn _from_bytes(_class: &Bound<'_, PyType>, py: Python<'_>, bytes: Vec<u8>) -> PyResult<Self> {
        let geometry = Call::plain(py)?.run(move || file::from_bytes(&bytes))?;
        Ok(Self::of(geometry.map_err(invalid)?))
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let geometry = self.geometry();
        let bytes = Call::plain(py)?.run(move || file::to_bytes(&geometry))?;
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

    /// The least and the greatest coordinates, (2, 3) float64 in the space of the caller; None for an empty mesh.
    #[getter]
    fn bounds(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        let bounds = self.geometry().bounds();
        bounds.map(|bounds| shaped(py, bounds.as_flattened().to_vec(), &[2], &[3])).transpose()
    }

    /// The vertices, (n, 3) float64 in the space of the caller: rounded to float32 less origin, and NaN for those that no triangle has.
    #[getter]
    fn vertices(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let vertices = self.geometry().vertices()?;
        shaped(py, vertices.as_flattened().to_vec(), &[vertices.len()], &[3])
    }

    /// The vertex indices of the triangles, (m, 3) int64, as in the build.
    #[getter]
    fn triangles(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let triangles = self.geometry().triangles();
        shaped(py, triangles.as_flattened().iter().map(|&index| i64::from(index)).collect(), &[triangles.len()], &[3])
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
