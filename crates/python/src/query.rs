//! Queries of slices of rays: arrays in, columns of hits out.

use std::ops::Range;

use canted::kernel::HitLists;
use canted::{Hit, Intersect, Ray, Side};
use pyo3::prelude::*;

use crate::arrays::{Column, NO_ORIGIN, Rows, Table, shown};
use crate::error::{filled, invalid, reserved};
use crate::frame::Near;
use crate::work::Call;

/// Rays of a job that finds one hit, and of a job that finds all: well below a hundredth of a second for all but the worst
/// meshes, and enough that a job costs nothing.
const RAYS_OF_JOB: usize = 1024;
const RAYS_OF_LIST_JOB: usize = 256;

/// The arguments `origins`, `directions`, `t_min` and `t_max`.
pub(crate) struct RayArrays<'py> {
    origins: Table<'py>,
    directions: Table<'py>,
    t_min: Column,
    t_max: Column,
    n: usize,
    shape: Vec<usize>,
}

impl<'py> RayArrays<'py> {
    /// Rays of shape (..., 3), or one ray; one origin or one direction serves all.
    pub(crate) fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        interval: [Option<&Bound<'py, PyAny>>; 2],
    ) -> PyResult<Self> {
        let origins = Table::of_any_shape(origins, "origins")?;
        let directions = Table::of_any_shape(directions, "directions")?;
        let shape = match (&origins.shape, &directions.shape) {
            (shape, other) if shape == other => shape,
            (_, shape) if origins.is_one => shape,
            (shape, _) if directions.is_one => shape,
            (one, other) => {
                return Err(invalid(match (&one[..], &other[..]) {
                    ([n], [m]) => format!("there are {n} origins, but {m} directions"),
                    _ => format!("there are origins of shape {}, but directions of shape {}", shown(one), shown(other)),
                }));
            }
        };
        let shape = shape.clone();
        let [t_min, t_max] = interval;
        let t_min = Column::new(t_min, "t_min", &shape, 0.0)?;
        let t_max = Column::new(t_max, "t_max", &shape, f64::INFINITY)?;
        let n = if origins.is_one { directions.len() } else { origins.len() };
        Ok(Self { origins, directions, t_min, t_max, n, shape })
    }

    /// The shape of the rays, without the coordinates.
    pub(crate) fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The rays, their origins less `origin`; they start near a mesh if there is one.
    pub(crate) fn rays(&self, origin: [f64; 3], near: Option<Near>) -> Rays<'_> {
        Rays {
            origins: self.origins.rows(origin),
            directions: self.directions.rows(NO_ORIGIN),
            t_min: &self.t_min,
            t_max: &self.t_max,
            n: self.n,
            near,
        }
    }
}

/// Rays that are read where they are used.
pub(crate) struct Rays<'a> {
    origins: Rows<'a>,
    directions: Rows<'a>,
    t_min: &'a Column,
    t_max: &'a Column,
    n: usize,
    near: Option<Near>,
}

/// Some of the rays.
#[derive(Default)]
pub(crate) struct Read {
    pub(crate) rays: Vec<Ray>,
    /// The `t` at which each starts; none without a mesh near which they start.
    pub(crate) starts: Vec<f64>,
}

impl Rays<'_> {
    pub(crate) fn len(&self) -> usize {
        self.n
    }

    /// All rays.
    pub(crate) fn all(&self) -> Read {
        self.read(0..self.n)
    }

    /// The rays of a range.
    fn read(&self, range: Range<usize>) -> Read {
        let [first_origin, first_direction] = [&self.origins, &self.directions].map(|rows| usize::from(rows.len() > 1));
        let mut read = Read { rays: Vec::with_capacity(range.len()), starts: vec![] };
        for i in range {
            let (at_origin, at_direction) = (i * first_origin, i * first_direction);
            let (t_min, t_max) = (self.t_min.get(i), self.t_max.get(i));
            let ray = match &self.near {
                None => Ray::new(self.origins.get(at_origin), self.directions.get(at_direction))
                    .between(t_min as f32, t_max as f32),
                Some(near) => {
                    let (origin, direction) = (self.origins.exact(at_origin), self.directions.exact(at_direction));
                    let start = near.start(origin, direction);
                    read.starts.push(start);
                    let origin: [f64; 3] = std::array::from_fn(|k| origin[k] + start * direction[k]);
                    // A negative end stays one, so that the ray never hits.
                    let t_min = if t_min >= 0.0 { (t_min - start).max(0.0) } else { t_min };
                    Ray::new(origin.map(|x| x as f32), direction.map(|x| x as f32))
                        .between(t_min as f32, (t_max - start) as f32)
                }
            };
            read.rays.push(ray);
        }
        read
    }
}

/// Hits as columns; a miss is `inf, -1, 0, 0, false`.
#[derive(Default)]
pub(crate) struct Columns {
    /// The ray of each hit, where there are other than one for each.
    pub(crate) ray: Option<Vec<i64>>,
    pub(crate) t: Vec<f32>,
    /// What is added to `t` in `f64`; empty for results in `f32`.
    pub(crate) starts: Vec<f64>,
    pub(crate) primitive: Vec<i32>,
    pub(crate) u: Vec<f32>,
    pub(crate) v: Vec<f32>,
    pub(crate) entering: Vec<bool>,
    /// Empty without instances.
    pub(crate) instance: Vec<i32>,
}

/// A number of a triangle or of an instance: both are below 2^31.
fn signed(index: u32) -> i32 {
    i32::try_from(index).unwrap_or(i32::MAX)
}

/// What finds a hit of each ray of a slice, and gets the number of its first ray.
pub(crate) type FindHits<'a> = dyn Fn(usize, &[Ray], &mut [Option<Hit>]) + Sync + 'a;

/// One hit of each ray.
pub(crate) fn closest_hits(
    call: &Call<'_>,
    find: &FindHits<'_>,
    rays: &Rays<'_>,
    has_instances: bool,
) -> PyResult<Columns> {
    let n = rays.len();
    let mut columns = Columns {
        ray: None,
        t: filled(n, f32::INFINITY)?,
        starts: filled(if rays.near.is_some() { n } else { 0 }, 0.0)?,
        primitive: filled(n, -1)?,
        u: filled(n, 0.0)?,
        v: filled(n, 0.0)?,
        entering: filled(n, false)?,
        instance: filled(if has_instances { n } else { 0 }, -1)?,
    };
    let mut instances = columns.instance.chunks_mut(RAYS_OF_JOB);
    let mut starts = columns.starts.chunks_mut(RAYS_OF_JOB);
    let parts = columns.t.chunks_mut(RAYS_OF_JOB).zip(columns.primitive.chunks_mut(RAYS_OF_JOB));
    let parts = parts.zip(columns.u.chunks_mut(RAYS_OF_JOB)).zip(columns.v.chunks_mut(RAYS_OF_JOB));
    let parts = parts.zip(columns.entering.chunks_mut(RAYS_OF_JOB)).enumerate();
    let mut rare = || (instances.next().unwrap_or_default(), starts.next().unwrap_or_default());
    let jobs = parts.map(|(i, part)| (i * RAYS_OF_JOB, part, rare())).collect();
    call.for_jobs(jobs, |(first, ((((t, primitive), u), v), entering), (instance, starts))| {
        let read = rays.read(first..first + t.len());
        let mut hits = vec![None; t.len()];
        find(first, &read.rays, &mut hits);
        starts.copy_from_slice(&read.starts);
        for (i, hit) in hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            (t[i], u[i], v[i]) = (hit.t, hit.u, hit.v);
            primitive[i] = signed(hit.primitive.0);
            entering[i] = hit.side == Side::Front;
            if let Some(instance) = instance.get_mut(i) {
                *instance = signed(hit.instance.0);
            }
        }
    })?;
    Ok(columns)
}

/// Whether each ray hits anything.
pub(crate) fn occluded(call: &Call<'_>, target: &dyn Intersect, rays: &Rays<'_>) -> PyResult<Vec<bool>> {
    let mut occluded = filled(rays.len(), false)?;
    let jobs = occluded.chunks_mut(RAYS_OF_JOB).enumerate().collect();
    call.for_jobs(jobs, |(i, occluded): (usize, &mut [bool])| {
        let first = i * RAYS_OF_JOB;
        target.occluded_many(&rays.read(first..first + occluded.len()).rays, occluded);
    })?;
    Ok(occluded)
}

/// All hits of all rays: those of the first ray in order of `t`, then those of the second, and so on.
pub(crate) fn all_hits(
    call: &Call<'_>,
    list: &(dyn Fn(&[Ray], &mut HitLists) + Sync),
    rays: &Rays<'_>,
    has_instances: bool,
) -> PyResult<Columns> {
    let n_jobs = rays.len().div_ceil(RAYS_OF_LIST_JOB);
    let mut parts: Vec<Columns> = reserved(n_jobs)?;
    parts.resize_with(n_jobs, Columns::default);
    let jobs = parts.iter_mut().enumerate().collect();
    call.for_jobs(jobs, |(i, part): (usize, &mut Columns)| {
        let range = i * RAYS_OF_LIST_JOB..rays.len().min((i + 1) * RAYS_OF_LIST_JOB);
        let read = rays.read(range.clone());
        let mut lists = HitLists::new();
        list(&read.rays, &mut lists);
        let of_rays = || lists.of_rays();
        part.ray = Some(range.zip(of_rays()).flat_map(|(ray, hits)| hits.iter().map(move |_| ray as i64)).collect());
        let starts = read.starts.iter().zip(of_rays());
        part.starts = starts.flat_map(|(&start, hits)| hits.iter().map(move |_| start)).collect();
        part.push(lists.hits(), has_instances);
    })?;
    joined(&parts, has_instances, rays.near.is_some())
}

impl Columns {
    /// Appends hits, without their ray.
    fn push(&mut self, hits: &[Hit], has_instances: bool) {
        self.t.extend(hits.iter().map(|hit| hit.t));
        self.primitive.extend(hits.iter().map(|hit| signed(hit.primitive.0)));
        self.u.extend(hits.iter().map(|hit| hit.u));
        self.v.extend(hits.iter().map(|hit| hit.v));
        self.entering.extend(hits.iter().map(|hit| hit.side == Side::Front));
        if has_instances {
            self.instance.extend(hits.iter().map(|hit| signed(hit.instance.0)));
        }
    }
}

/// The columns of all parts, one after another.
fn joined(parts: &[Columns], has_instances: bool, has_starts: bool) -> PyResult<Columns> {
    fn join<'a, T: Copy + 'a>(n: usize, parts: impl Iterator<Item = &'a [T]>) -> PyResult<Vec<T>> {
        let mut all = reserved(n)?;
        parts.for_each(|part| all.extend_from_slice(part));
        Ok(all)
    }
    let n = parts.iter().map(|part| part.t.len()).sum();
    Ok(Columns {
        ray: Some(join(n, parts.iter().filter_map(|part| part.ray.as_deref()))?),
        t: join(n, parts.iter().map(|part| &part.t[..]))?,
        starts: join(if has_starts { n } else { 0 }, parts.iter().map(|part| &part.starts[..]))?,
        primitive: join(n, parts.iter().map(|part| &part.primitive[..]))?,
        u: join(n, parts.iter().map(|part| &part.u[..]))?,
        v: join(n, parts.iter().map(|part| &part.v[..]))?,
        entering: join(n, parts.iter().map(|part| &part.entering[..]))?,
        instance: join(if has_instances { n } else { 0 }, parts.iter().map(|part| &part.instance[..]))?,
    })
}
