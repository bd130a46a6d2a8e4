//! Triangles that overlap regions: boxes, spheres and frusta.

use canted::distance::Convex;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Column, NO_ORIGIN, Table, shaped, shown};
use crate::error::invalid;
use crate::work::Call;

/// Regions of a job.
const REGIONS_OF_JOB: usize = 16;

/// A region, relative to the origin of the query.
pub(crate) enum Region {
    Convex(Box<Convex>),
    Sphere { center: [f64; 3], radius: f64 },
}

/// The regions of a call.
pub(crate) enum Regions<'py> {
    Boxes { low: Table<'py>, high: Table<'py> },
    Spheres { center: Table<'py>, radius: Column },
    Frusta { near: Table<'py>, far: Table<'py> },
}

/// An instance and a triangle of it; instance 0 without instances.
pub(crate) type Pair = (u32, u32);

impl<'py> Regions<'py> {
    pub(crate) fn boxes(low: &Bound<'py, PyAny>, high: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (low, high) = (Table::of_any_shape(low, "low")?, Table::of_any_shape(high, "high")?);
        is_one_shape(["low", "high"], &low, &high)?;
        let (least, greatest) = (low.rows(NO_ORIGIN), high.rows(NO_ORIGIN));
        for i in 0..low.len() {
            let (low, high) = (least.exact(i), greatest.exact(i));
            // From infinity to minus infinity: empty on purpose.
            let is_empty = low == [f64::INFINITY; 3] && high == [f64::NEG_INFINITY; 3];
            if let Some(k) = (0..3).find(|&k| low[k] > high[k] && !is_empty) {
                let (axis, low, high) = (["x", "y", "z"][k], low[k], high[k]);
                return Err(invalid(format!(
                    "box {i} is inverted: low is {low} in {axis}, high is {high}; exchange both, or use inf and -inf for an empty box"
                )));
            }
        }
        Ok(Self::Boxes { low, high })
    }

    pub(crate) fn spheres(center: &Bound<'py, PyAny>, radius: &Bound<'py, PyAny>) -> PyResult<Self> {
        let center = Table::of_any_shape(center, "center")?;
        let radius = Column::new(Some(radius), "radius", &center.shape, 0.0)?;
        Ok(Self::Spheres { center, radius })
    }

    pub(crate) fn frusta(near: &Bound<'py, PyAny>, far: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (near, far) = (Table::of_faces(near, "near")?, Table::of_faces(far, "far")?);
        is_one_shape(["near", "far"], &near, &far)?;
        Ok(Self::Frusta { near, far })
    }

    fn len(&self) -> usize {
        match self {
            Self::Boxes { low, .. } => low.len(),
            Self::Spheres { center, .. } => center.len(),
            Self::Frusta { near, .. } => near.len() / 4,
        }
    }

    /// Which triangles overlap which region, by `find`, which appends those of one region: a dict of columns.
    pub(crate) fn overlaps<'a>(
        &self,
        call: &Call<'a>,
        origin: [f64; 3],
        has_instances: bool,
        find: impl Fn(&Region, &mut Vec<Pair>) + Sync + Send,
    ) -> PyResult<Bound<'a, PyDict>> {
        let (get, n) = (self.reader(origin), self.len());
        let mut parts: Vec<Vec<(i64, Pair)>> = vec![vec![]; n.div_ceil(REGIONS_OF_JOB)];
        let jobs = parts.iter_mut().enumerate().collect();
        call.for_jobs(jobs, |(job, part): (usize, &mut Vec<(i64, Pair)>)| {
            let mut pairs = vec![];
            for i in job * REGIONS_OF_JOB..n.min((job + 1) * REGIONS_OF_JOB) {
                find(&get(i), &mut pairs);
                part.extend(pairs.drain(..).map(|pair| (i as i64, pair)));
            }
        })?;
        let (found, columns) = (parts.concat(), PyDict::new(call.py));
        let shape = [found.len()];
        columns.set_item("region", shaped(call.py, found.iter().map(|row| row.0).collect(), &shape, &[])?)?;
        let column = |pick: fn(Pair) -> u32| found.iter().map(|row| pick(row.1).cast_signed()).collect::<Vec<i32>>();
        if has_instances {
            columns.set_item("instance", shaped(call.py, column(|pair| pair.0), &shape, &[])?)?;
        }
        columns.set_item("primitive", shaped(call.py, column(|pair| pair.1), &shape, &[])?)?;
        Ok(columns)
    }

    /// What reads a region relative to an origin.
    fn reader(&self, origin: [f64; 3]) -> Box<dyn Fn(usize) -> Region + Sync + Send + '_> {
        match self {
            Self::Boxes { low, high } => {
                let (low, high) = (low.rows(origin), high.rows(origin));
                Box::new(move |i| Region::Convex(Box::new(Convex::from_aabb(low.get(i), high.get(i)))))
            }
            Self::Spheres { center, radius } => {
                let center = center.rows(origin);
                Box::new(move |i| Region::Sphere { center: center.exact(i), radius: radius.get(i) })
            }
            Self::Frusta { near, far } => {
                let (near, far) = (near.rows(origin), far.rows(origin));
                Box::new(move |i| {
                    let [near, far] = [near, far].map(|rows| std::array::from_fn(|k| rows.get(4 * i + k)));
                    Region::Convex(Box::new(Convex::from_frustum(near, far)))
                })
            }
        }
    }
}

fn is_one_shape(names: [&str; 2], one: &Table<'_>, other: &Table<'_>) -> PyResult<()> {
    if one.shape == other.shape {
        return Ok(());
    }
    let ([a, b], [x, y]) = (names, [one, other].map(|table| shown(&table.shape)));
    Err(invalid(format!("there are regions of shape {x} in {a}, but of shape {y} in {b}")))
}
