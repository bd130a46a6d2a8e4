//! Queries of slices of rays: arrays in, columns of hits out.

use std::ops::Range;

use canted::kernel::HitLists;
use canted::{Hit, Intersect, Ray, Side};
use pyo3::prelude::*;

use crate::arrays::{Column, NO_ORIGIN, Rows, Table};
use crate::error::{filled, invalid, reserved};
use crate::threads::Threads;
use crate::work::for_jobs;

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
}

impl<'py> RayArrays<'py> {
    /// Arrays of n rays, or one ray; one origin or one direction serves all.
    pub(crate) fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        interval: [Option<&Bound<'py, PyAny>>; 2],
    ) -> PyResult<Self> {
        let tables = [Table::new(origins, "origins", true)?, Table::new(directions, "directions", true)?];
        let [n_origins, n_directions] = [&tables[0], &tables[1]].map(Table::len);
        let n = match (n_origins, n_directions) {
            (n, m) if n == m => n,
            (1, n) if tables[0].is_one => n,
            (n, 1) if tables[1].is_one => n,
            (n, m) => return Err(invalid(format!("there are {n} origins, but {m} directions"))),
        };
        let [origins, directions] = tables;
        let [t_min, t_max] = interval;
        let (t_min, t_max) = (Column::new(t_min, "t_min", n, 0.0)?, Column::new(t_max, "t_max", n, f32::INFINITY)?);
        Ok(Self { origins, directions, t_min, t_max, n })
    }

    /// The rays, their origins less `origin`.
    pub(crate) fn rays(&self, origin: [f64; 3]) -> Rays<'_> {
        Rays {
            origins: self.origins.rows(origin),
            directions: self.directions.rows(NO_ORIGIN),
            t_min: &self.t_min,
            t_max: &self.t_max,
            n: self.n,
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
}

impl Rays<'_> {
    pub(crate) fn len(&self) -> usize {
        self.n
    }

    /// Replaces `rays` by those of a range.
    fn read(&self, range: Range<usize>, rays: &mut Vec<Ray>) {
        let [first_origin, first_direction] = [&self.origins, &self.directions].map(|rows| usize::from(rows.len() > 1));
        rays.clear();
        rays.extend(range.map(|i| {
            Ray::new(self.origins.get(i * first_origin), self.directions.get(i * first_direction))
                .between(self.t_min.get(i), self.t_max.get(i))
        }));
    }
}

/// Hits as columns; a miss is `inf, -1, 0, 0, false`.
#[derive(Default)]
pub(crate) struct Columns {
    /// The ray of each hit, where there are other than one for each.
    pub(crate) ray: Option<Vec<i64>>,
    pub(crate) t: Vec<f32>,
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

/// The closest hit of each ray.
pub(crate) fn closest_hits(
    py: Python<'_>,
    threads: &Threads,
    target: &dyn Intersect,
    rays: &Rays<'_>,
    has_instances: bool,
) -> PyResult<Columns> {
    let n = rays.len();
    let mut columns = Columns {
        ray: None,
        t: filled(n, f32::INFINITY)?,
        primitive: filled(n, -1)?,
        u: filled(n, 0.0)?,
        v: filled(n, 0.0)?,
        entering: filled(n, false)?,
        instance: filled(if has_instances { n } else { 0 }, -1)?,
    };
    let mut instances = columns.instance.chunks_mut(RAYS_OF_JOB);
    let parts = columns.t.chunks_mut(RAYS_OF_JOB).zip(columns.primitive.chunks_mut(RAYS_OF_JOB));
    let parts = parts.zip(columns.u.chunks_mut(RAYS_OF_JOB)).zip(columns.v.chunks_mut(RAYS_OF_JOB));
    let parts = parts.zip(columns.entering.chunks_mut(RAYS_OF_JOB)).enumerate();
    let jobs = parts.map(|(i, part)| (i * RAYS_OF_JOB, part, instances.next().unwrap_or_default())).collect();
    for_jobs(py, threads, jobs, |(first, ((((t, primitive), u), v), entering), instance)| {
        let mut read = Vec::with_capacity(t.len());
        rays.read(first..first + t.len(), &mut read);
        let mut hits = vec![None; t.len()];
        target.closest_hits(&read, &mut hits);
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
pub(crate) fn occluded(
    py: Python<'_>,
    threads: &Threads,
    target: &dyn Intersect,
    rays: &Rays<'_>,
) -> PyResult<Vec<bool>> {
    let mut occluded = filled(rays.len(), false)?;
    let jobs = occluded.chunks_mut(RAYS_OF_JOB).enumerate().collect();
    for_jobs(py, threads, jobs, |(i, occluded): (usize, &mut [bool])| {
        let first = i * RAYS_OF_JOB;
        let mut read = Vec::with_capacity(occluded.len());
        rays.read(first..first + occluded.len(), &mut read);
        target.occluded_many(&read, occluded);
    })?;
    Ok(occluded)
}

/// All hits of all rays: those of the first ray in order of `t`, then those of the second, and so on.
pub(crate) fn all_hits(
    py: Python<'_>,
    threads: &Threads,
    list: &(dyn Fn(&[Ray], &mut HitLists) + Sync),
    rays: &Rays<'_>,
    has_instances: bool,
) -> PyResult<Columns> {
    let n_jobs = rays.len().div_ceil(RAYS_OF_LIST_JOB);
    let mut parts: Vec<Columns> = reserved(n_jobs)?;
    parts.resize_with(n_jobs, Columns::default);
    let jobs = parts.iter_mut().enumerate().collect();
    for_jobs(py, threads, jobs, |(i, part): (usize, &mut Columns)| {
        let range = i * RAYS_OF_LIST_JOB..rays.len().min((i + 1) * RAYS_OF_LIST_JOB);
        let mut read = Vec::with_capacity(range.len());
        rays.read(range.clone(), &mut read);
        let mut lists = HitLists::new();
        list(&read, &mut lists);
        let of_rays = range.zip(lists.of_rays());
        part.ray = Some(of_rays.flat_map(|(ray, hits)| hits.iter().map(move |_| ray as i64)).collect());
        part.push(lists.hits(), has_instances);
    })?;
    joined(&parts, has_instances)
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
fn joined(parts: &[Columns], has_instances: bool) -> PyResult<Columns> {
    fn join<'a, T: Copy + 'a>(n: usize, parts: impl Iterator<Item = &'a [T]>) -> PyResult<Vec<T>> {
        let mut all = reserved(n)?;
        parts.for_each(|part| all.extend_from_slice(part));
        Ok(all)
    }
    let n = parts.iter().map(|part| part.t.len()).sum();
    Ok(Columns {
        ray: Some(join(n, parts.iter().filter_map(|part| part.ray.as_deref()))?),
        t: join(n, parts.iter().map(|part| &part.t[..]))?,
        primitive: join(n, parts.iter().map(|part| &part.primitive[..]))?,
        u: join(n, parts.iter().map(|part| &part.u[..]))?,
        v: join(n, parts.iter().map(|part| &part.v[..]))?,
        entering: join(n, parts.iter().map(|part| &part.entering[..]))?,
        instance: join(if has_instances { n } else { 0 }, parts.iter().map(|part| &part.instance[..]))?,
    })
}
