//! Meshes against meshes, and spheres that move.

use std::sync::Arc;

use canted::collide::{self, Pose};
use canted::{Hit, InstanceId};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::arrays::{Column, matrix, shaped};
use crate::error::invalid;
use crate::geometry::Geometry;
use crate::hits::Hits;
use crate::points::Surface;
use crate::query::{RayArrays, closest_hits};
use crate::work::Call;

/// Queries of more triangles run on a thread of their own, so that Ctrl-C abandons them.
const LONG: usize = 4096;

/// The nearest points of two meshes.
///
/// Attributes
/// ----------
/// distance : float
///     Distance; 0 where the meshes touch, inf where one is empty.
/// points : (2, 3) float64
///     A point of each mesh at that distance, in the space of the first one; NaN where one is empty. Where they touch, a point that both have.
/// primitives : (2,) int32
///     The triangles that the points are on; of several at one distance the lowest; -1 where a mesh is empty.
#[pyclass(frozen, weakref, module = "canted", get_all)]
pub(crate) struct Distance {
    distance: f64,
    points: Py<PyAny>,
    primitives: Py<PyAny>,
}

#[pymethods]
impl Distance {
    #[classmethod]
    fn _of_parts(_class: &Bound<'_, PyType>, distance: f64, points: Py<PyAny>, primitives: Py<PyAny>) -> Self {
        Self { distance, points, primitives }
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let parts = (self.distance, &self.points, &self.primitives).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of_parts")?, parts))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let [a, b]: [i32; 2] = self.primitives.bind(py).call_method0("tolist")?.extract()?;
        Ok(format!("Distance({} between triangles {a} and {b})", self.distance))
    }
}

/// The first contact of a mesh that moves.
///
/// Attributes
/// ----------
/// t : float
///     When the meshes touch, not after it, in units of the motion; the gap at t is below 2^-40 of the coordinates. 0 where they overlap at the start.
/// position : (3,) float64
///     The point of the mesh at rest that is touched, in its space.
/// normal : (3,) float64
///     Across the contact, from the mesh at rest to the one that moves, of unit length; zero where they overlap at the start.
/// primitives : (2,) int32
///     The triangles that touch; of several at one t the lowest.
/// starts_inside : bool
///     Whether they overlap at the start.
#[pyclass(frozen, weakref, module = "canted", get_all)]
pub(crate) struct Contact {
    t: f64,
    position: Py<PyAny>,
    normal: Py<PyAny>,
    primitives: Py<PyAny>,
    starts_inside: bool,
}

#[pymethods]
impl Contact {
    #[classmethod]
    fn _of_parts(
        _class: &Bound<'_, PyType>,
        t: f64,
        position: Py<PyAny>,
        normal: Py<PyAny>,
        primitives: Py<PyAny>,
        starts_inside: bool,
    ) -> Self {
        Self { t, position, normal, primitives, starts_inside }
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let parts = (self.t, &self.position, &self.normal, &self.primitives, self.starts_inside).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of_parts")?, parts))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let [a, b]: [i32; 2] = self.primitives.bind(py).call_method0("tolist")?.extract()?;
        Ok(format!("Contact(t={}, triangles {a} and {b})", self.t))
    }
}

/// Two meshes, and the pose of the second one, in the space of the first one less its origin.
pub(crate) struct Pair {
    a: Arc<Geometry>,
    b: Arc<Geometry>,
    pose: Pose,
}

impl Pair {
    /// The argument `pose`: a matrix of shape (4, 4), or none for the identity.
    pub(crate) fn new(a: Arc<Geometry>, b: Arc<Geometry>, pose: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let (from, to) = (b.origin, a.origin);
        let Some(argument) = pose else {
            let shift = std::array::from_fn(|k| from[k] - to[k]);
            return Ok(Self { a, b, pose: Pose::translation(shift) });
        };
        let [x, y, z, last] = matrix(argument, "pose")?;
        if last != [0.0, 0.0, 0.0, 1.0] {
            return Err(invalid(format!("pose has the last row {last:?}, not 0, 0, 0, 1")));
        }
        // A point of the second mesh is less its origin, and its image becomes less that of the first.
        let moved = |k: usize, [x, y, z, w]: [f64; 4]| {
            let of_origin = if from == [0.0; 3] { 0.0 } else { x * from[0] + y * from[1] + z * from[2] };
            [x, y, z, (of_origin + w) - to[k]]
        };
        let pose = Pose::from_rows([moved(0, x), moved(1, y), moved(2, z)]);
        if !pose.is_usable() {
            return Err(invalid("pose has a number that is not finite or exceeds 2^200"));
        }
        Ok(Self { a, b, pose })
    }

    /// Runs a query of both meshes, without Python's global lock.
    fn run<T: Send + 'static>(self, call: &Call<'_>, query: impl FnOnce(&Self) -> T + Send + 'static) -> PyResult<T> {
        if self.a.mesh.n_primitives().saturating_add(self.b.mesh.n_primitives()) < LONG {
            call.run_short(|| query(&self))
        } else {
            call.run(move || query(&self))
        }
    }

    pub(crate) fn pairs(self, call: &Call<'_>) -> PyResult<Py<PyAny>> {
        let found = self.run(call, |Self { a, b, pose }| {
            let mut found = vec![];
            collide::pairs(&*a.mesh, Pose::IDENTITY, &*b.mesh, *pose, &mut found);
            found
        })?;
        rows(call.py, &found)
    }

    pub(crate) fn overlaps(self, call: &Call<'_>) -> PyResult<bool> {
        self.run(call, |Self { a, b, pose }| collide::overlaps(&*a.mesh, Pose::IDENTITY, &*b.mesh, *pose))
    }

    pub(crate) fn cast(self, call: &Call<'_>, motion: [f64; 3], t_max: f64) -> PyResult<Option<Contact>> {
        if !(motion.iter().all(|x| x.is_finite()) && t_max >= 0.0) {
            return Err(invalid(format!(
                "the motion {motion:?} until {t_max} is not one; use finite numbers, and a t_max of 0 or more"
            )));
        }
        let (py, origin) = (call.py, self.a.origin);
        let found = self.run(call, move |Self { a, b, pose }| {
            collide::cast(&*a.mesh, Pose::IDENTITY, &*b.mesh, *pose, motion, t_max)
        })?;
        let Some(found) = found else { return Ok(None) };
        let position = std::array::from_fn::<_, 3, _>(|k| found.position[k] + origin[k]);
        let primitives = found.primitives.map(|primitive| primitive.0.cast_signed());
        Ok(Some(Contact {
            t: found.t,
            position: shaped(py, position.to_vec(), &[3], &[])?,
            normal: shaped(py, found.normal.to_vec(), &[3], &[])?,
            primitives: shaped(py, primitives.to_vec(), &[2], &[])?,
            starts_inside: found.starts_inside,
        }))
    }

    pub(crate) fn distance(self, call: &Call<'_>) -> PyResult<Distance> {
        let (py, origin) = (call.py, self.a.origin);
        let found = self.run(call, |Self { a, b, pose }| {
            collide::distance(&*a.mesh, Pose::IDENTITY, &*b.mesh, *pose, f64::INFINITY)
        })?;
        let (distance, points, primitives) = match found {
            Some(found) => {
                let points = found.points.map(|point| std::array::from_fn(|k| point[k] + origin[k]));
                (found.distance, points, found.primitives.map(|primitive| primitive.0.cast_signed()))
            }
            None => (f64::INFINITY, [[f64::NAN; 3]; 2], [-1; 2]),
        };
        Ok(Distance {
            distance,
            points: shaped(py, points.as_flattened().to_vec(), &[2], &[3])?,
            primitives: shaped(py, primitives.to_vec(), &[2], &[])?,
        })
    }
}

pub(crate) fn self_intersections(call: &Call<'_>, geometry: Arc<Geometry>) -> PyResult<Py<PyAny>> {
    let pair = Pair { a: Arc::clone(&geometry), b: geometry, pose: Pose::IDENTITY };
    let found = pair.run(call, |Pair { a, .. }| {
        let mut found = vec![];
        collide::self_intersections(&*a.mesh, &mut found);
        found
    })?;
    rows(call.py, &found)
}

/// Pairs as an array of shape (n, 2).
fn rows(py: Python<'_>, found: &[collide::PrimitivePair]) -> PyResult<Py<PyAny>> {
    numbers(py, found.iter().map(|pair| pair.map(|primitive| primitive.0)))
}

/// Pairs of numbers as an array of shape (n, 2).
pub(crate) fn numbers(py: Python<'_>, pairs: impl ExactSizeIterator<Item = [u32; 2]>) -> PyResult<Py<PyAny>> {
    let n = pairs.len();
    shaped(py, pairs.flatten().map(u32::cast_signed).collect::<Vec<i32>>(), &[n], &[2])
}

/// The first contact of a sphere along each ray.
pub(crate) fn cast_sphere(
    call: &Call<'_>,
    geometry: Arc<Geometry>,
    arrays: &RayArrays<'_>,
    radius: &Bound<'_, PyAny>,
    origin: [f64; 3],
) -> PyResult<Hits> {
    let radius = Column::new(Some(radius), "radius", arrays.shape(), 0.0)?;
    let n = arrays.shape().iter().product();
    let mut greatest = 0.0_f64;
    for i in 0..n {
        let one = radius.get(i);
        if !(one >= 0.0 && one.is_finite()) {
            return Err(invalid(format!("the radius of sphere {i} is {one}; use a finite number of 0 or more")));
        }
        greatest = greatest.max(one);
    }
    let near = geometry.near().map(|near| near.grown(greatest));
    let mesh = &*geometry.mesh;
    let columns = closest_hits(
        call,
        &|first, rays, hits| {
            for (i, (ray, hit)) in rays.iter().zip(hits).enumerate() {
                *hit = collide::cast_sphere(mesh, ray, radius.get(first + i)).map(|contact| Hit {
                    t: contact.t as f32,
                    u: contact.uv[0] as f32,
                    v: contact.uv[1] as f32,
                    primitive: contact.primitive,
                    instance: InstanceId(0),
                    side: contact.side,
                });
            }
        },
        &arrays.rays(origin, near),
        false,
    )?;
    Hits::new(call.py, columns, Surface::Mesh { geometry, origin }, arrays.shape())
}
