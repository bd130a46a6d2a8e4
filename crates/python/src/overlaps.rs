//! Triangles that overlap regions: boxes, spheres, frusta, and convex hulls with a radius.

use std::ops::ControlFlow;

use canted::collide::Shape;
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
    Hull(RoundHull),
}

/// All points within a radius of the convex hull of some points.
pub(crate) struct RoundHull {
    points: Vec<[f64; 3]>,
    radius: f64,
}

impl Shape for RoundHull {
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        self.points.iter().for_each(|&point| visit(point));
    }

    fn radius(&self) -> f64 {
        self.radius
    }
}

/// What is asked for: the argument `form`.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Form {
    All,
    Any,
    First,
    Count,
}

impl Form {
    pub(crate) fn of(name: &str) -> PyResult<Self> {
        match name {
            "all" => Ok(Self::All),
            "any" => Ok(Self::Any),
            "first" => Ok(Self::First),
            "count" => Ok(Self::Count),
            _ => Err(invalid(format!("form is '{name}'; use 'all', 'any', 'first' or 'count'"))),
        }
    }
}

/// The regions of a call.
pub(crate) enum Regions<'py> {
    Boxes { low: Table<'py>, high: Table<'py> },
    Spheres { center: Table<'py>, radius: Column },
    Frusta { near: Table<'py>, far: Table<'py> },
    Hulls { points: Table<'py>, k: usize, radius: Column },
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

    pub(crate) fn hulls(points: &Bound<'py, PyAny>, radius: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        let (points, k) = Table::of_groups(points, "points")?;
        let radius = Column::new(radius, "radius", &points.shape, 0.0)?;
        let bad = (0..points.shape.iter().product()).find(|&i| !(radius.get(i) >= 0.0 && radius.get(i).is_finite()));
        match bad {
            Some(i) => {
                Err(invalid(format!("the radius of hull {i} is {}; use a finite number of 0 or more", radius.get(i))))
            }
            None => Ok(Self::Hulls { points, k, radius }),
        }
    }

    /// The shape of the regions.
    fn shape(&self) -> &[usize] {
        match self {
            Self::Boxes { low, .. } => &low.shape,
            Self::Spheres { center, .. } => &center.shape,
            Self::Frusta { near, .. } => &near.shape,
            Self::Hulls { points, .. } => &points.shape,
        }
    }

    /// Which triangles overlap which region, in a form, by `find`, which calls a function with those of one region until it breaks; a triangle may come
    /// twice.
    pub(crate) fn overlaps<'a>(
        &self,
        call: &Call<'a>,
        origin: [f64; 3],
        (has_instances, form): (bool, Form),
        find: impl Fn(&Region, &mut dyn FnMut(Pair) -> ControlFlow<()>) + Sync + Send,
    ) -> PyResult<Bound<'a, PyAny>> {
        let (get, shape) = (self.reader(origin), self.shape());
        let n = shape.iter().product::<usize>();
        let mut parts: Vec<Vec<(i64, Pair)>> = vec![vec![]; n.div_ceil(REGIONS_OF_JOB)];
        let jobs = parts.iter_mut().enumerate().collect();
        call.for_jobs(jobs, |(job, part): (usize, &mut Vec<(i64, Pair)>)| {
            let mut pairs = vec![];
            for i in job * REGIONS_OF_JOB..n.min((job + 1) * REGIONS_OF_JOB) {
                find(&get(i), &mut |pair| {
                    pairs.push(pair);
                    if form == Form::Any { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                });
                pairs.sort_unstable();
                pairs.dedup();
                if form == Form::First {
                    pairs.truncate(1);
                }
                part.extend(pairs.drain(..).map(|pair| (i as i64, pair)));
            }
        })?;
        let (py, found) = (call.py, parts.concat());
        let column = |pick: fn(Pair) -> u32| found.iter().map(|row| pick(row.1).cast_signed()).collect::<Vec<i32>>();
        let mut columns = vec![("primitive", column(|pair| pair.1))];
        if has_instances {
            columns.insert(0, ("instance", column(|pair| pair.0)));
        }
        let dict = PyDict::new(py);
        match form {
            Form::All => {
                let rows = [found.len()];
                dict.set_item("region", shaped(py, found.iter().map(|row| row.0).collect(), &rows, &[])?)?;
                for (name, column) in columns {
                    dict.set_item(name, shaped(py, column, &rows, &[])?)?;
                }
            }
            Form::First => {
                for (name, column) in columns {
                    let mut all = vec![-1; n];
                    found.iter().zip(column).for_each(|(row, number)| all[row.0 as usize] = number);
                    dict.set_item(name, shaped(py, all, shape, &[])?)?;
                }
            }
            Form::Any | Form::Count => {
                let mut counts = vec![0_i64; n];
                found.iter().for_each(|row| counts[row.0 as usize] += 1);
                let counts = match form {
                    Form::Any => shaped(py, counts.into_iter().map(|count| count > 0).collect(), shape, &[])?,
                    _ => shaped(py, counts, shape, &[])?,
                };
                return Ok(counts.into_bound(py));
            }
        }
        Ok(dict.into_any())
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
            Self::Hulls { points, k, radius } => {
                let points = points.rows(origin);
                Box::new(move |i| {
                    let points = (i * k..(i + 1) * k).map(|row| points.exact(row)).collect();
                    Region::Hull(RoundHull { points, radius: radius.get(i) })
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
